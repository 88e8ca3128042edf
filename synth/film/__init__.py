"""The photographic film: a record or a scene exposed to moving paper, developed, soiled and scanned."""
