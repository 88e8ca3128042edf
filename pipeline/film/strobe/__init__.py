"""Traces read at the chronometer marks alone, by the edges of the gaps."""
