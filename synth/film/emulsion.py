"""From light to silver to pixels: characteristic curve, grain, and the scanner's light."""

from __future__ import annotations

import math

import numpy as np

from synth.film.pixels import Pixels
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers

SCANNER_RANGE = 2.2
"""The scanner shows a density as the value 10^(-density / 2.2) of its full scale."""


@kernel
def develop(
    image: Pixels, left: Integers, right: Integers, fog: Floats, fog_rise: float, density_max: float,
    half_exposure: float, gamma: float,
) -> None:  # fmt: skip
    """Turn exposure into density, in place; what is not paper gets none.

    Parameters
    ----------
    image : (rows, columns) float32
    left, right : (rows,) int64
        First column of the paper and the one after its last.
    fog : (rows,) float64
        At column 0.
    fog_rise : float
        From column to column.
    density_max, half_exposure, gamma : float
        Of the characteristic curve.
    """
    rows, columns = image.shape
    least = 1e-6 * half_exposure
    for y in range(rows):
        for x in range(columns):
            if x < left[y] or x >= right[y]:
                image[y, x] = 0.0
                continue
            veil = fog[y] + fog_rise * x
            light = image[y, x]
            if light > least:
                veil += (density_max - veil) / (1.0 + math.exp(gamma * math.log(half_exposure / light)))
            image[y, x] = veil


@kernel
def scan(image: Pixels, noise: Pixels, grain: np.float32, scale: np.float32, brightness: Pixels) -> None:
    """Turn density into the light that the scanner sees, 0 to 1, in place.

    Parameters
    ----------
    image : (rows, columns) float32
    noise : (rows, columns) float32
        Standard normal.
    grain : float32
        1 sigma of the density where it is 1.
    scale : float32
        Natural logarithm of the light per density, negative.
    brightness : (columns,) float32
        Of the scanner's lamp.
    """
    rows, columns = image.shape
    for y in range(rows):
        for x in range(columns):
            density = image[y, x]
            density += grain * np.sqrt(density) * noise[y, x]
            image[y, x] = brightness[x] * np.exp(scale * max(density, np.float32(0.0)))
