"""The type of images while they are made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.float32]
STRIP = 1024
"""Rows of a strip, of the image file and of all chance."""
