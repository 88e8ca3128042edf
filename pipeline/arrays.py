"""Names for the arrays that the pipeline passes about."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
"""Real numbers, double precision in practice."""
Complexes = NDArray[np.complexfloating[Any, Any]]
"""Complex numbers, double precision in practice."""
