"""Rows of the table for the truth of a simulated record and of an exposed film, which no estimator or reader ever sees.

Images of films count as the film lies when its rows run with time: pixel i reaches from i to i + 1, row i of the image
has its centre line at i + 0.5, and is sample i of the file's time.
"""

from pathlib import Path

TABLE = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
