"""How light became pixels on one film: blank paper, grain and characteristic curve, told from the film itself."""
