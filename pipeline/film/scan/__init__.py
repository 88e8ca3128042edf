"""Images of films, opened: any common file, any way round, one strip or several, read piece by piece."""
