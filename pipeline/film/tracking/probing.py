"""A first look at the film: sections here and there, what swings on them, and with what spot, slit, curve and grain.

A line's exposure follows from its slope alone (dwell time), which runs from 0 at the turning points to the steepest in
the middle: the pixels' darkness against the exposure that the spot must have left is the characteristic curve.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from pipeline.arrays import Floats
from pipeline.film.emulsion import (
    FilmEmulsion,
    Optics,
    ToneCurve,
    bounded_growth,
    clumps_of,
    plain_emulsion,
    shown_darkness,
)
from pipeline.film.scan.opening import OpenScan
from pipeline.film.tracking.motion import MOST_NODES, nodes_of, place_and_rate, profile
from pipeline.film.tracking.pieces import Section, follow_from
from pipeline.film.tracking.row_reading import lit_columns
from pipeline.film.tracking.seeding import find_swings, read_section, spot_size
from synth.kernels.compiled import making_kernel

FIRST_ROWS, TALLEST = 512, 4096  # of the sections looked at, at first and where nothing is found
PLACES = (0.5, 0.15, 0.85, 0.3, 0.7, 0.02, 0.95)
MORE_PLACES = (0.4, 0.6, 0.22, 0.78, 0.09, 0.91, 0.35, 0.65, 0.45, 0.55)  # where none of the others shows all traces
ENOUGH, ENOUGH_ROWS = 3, 60  # sections with traces; and rows of one, of turning points as of steep strokes
FLAT = 0.4  # of the steepest slope, below which a trace turns
REFINEMENTS, ANEW = 8, 2  # at most; and those in which traces are found anew, as a first guess may miss one
ROUGH = 1e-3  # growth of the variance with darkness, below which grain is finer than what is known of lines
GUESSED = 0.01  # the same of the square of a first guess of the greatest darkness
HIDDEN = 1.8  # of a wrong shear, readings made with it show about half; of short sections, more
ALIKE, SETTLED_SHEAR = 0.005, 2e-5  # changes of the logarithms of spot and curve, and of the shear, that end them
SURE = 0.6  # share of rows read, with the film's own optics, by which a trace is one
ASKEW = 0.0045 * np.array([0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6, -6, 7, -7, 8, -8])  # rows a column
UPRIGHT = 0.8  # share of rows read, with a first guess of the optics, by which the slit stands about so
NEAR_GAP = 5  # rows beside one that lacks light
LACKING = 0.9
ALIKE_ROWS = 61  # rows of like slope, about, that say how bright a line seems there
LEAST_ROWS, MOST_ROWS = 40, 260
ROUNDS, SETTLED, HUBER = 20, 0.1, 3.0  # chi square of a step that ends them
MOST_BLUR = 0.18  # px2, half the variance of a scanner's blur: grain that is alike farther is the film's
USUAL = 1.3, 2.0  # contrast and shoulder of emulsions
SHAPE, LAMPS = 5, 0.3  # unknowns of spot and curve; 1 sigma of a lamp's brightness, relative
PRIOR_SIGMA = np.array([1e3, 0.5, 1e3, 0.3, 1.0])  # of the logarithms of spot, darkest, middle, contrast and shoulder
SHEAR_SWINGS = 1.5


def measure_emulsion(scan: OpenScan) -> FilmEmulsion:
    """Blank film, grain, characteristic curve and spot, from strips spread over the film, dark lines on light."""
    plain = plain_emulsion(scan)
    clumps, blurred = clumps_of(scan, plain)
    # of white grain that was blurred a little, pixels beside each other share twice the blur's half variance, and next
    # ones nothing; what rounding makes of faint grain they share alike
    beside, next_one = np.append(clumps, [0.0, 0.0])[1:3]
    sharp = replace(plain, blur=float(np.clip(0.5 * (beside - next_one), 0.0, MOST_BLUR)))
    clumps, variance = clumps_of(scan, sharp)
    sharp = replace(sharp, clumps=clumps, grain=plain.grain * (variance / blurred))
    section = probe(scan, sharp)
    if section is None:
        return sharp
    at = section.optics
    return replace(sharp, spot=at.spot, shear=at.shear, curve=at.curve, grain=at.grain, swing=section.period)


def first_optics(darkness: NDArray[np.float32], sigma: float) -> Optics:
    """What a piece of film shows of spot and curve before any trace is known."""
    curve = ToneCurve(max(_darkest(darkness), 3.0 * sigma), 0.2, 1.5)
    # fine grain would make an outlier of all that this curve is wrong by
    growth = max(10.0 * sigma**2, ROUGH, GUESSED * curve.darkest**2)
    return Optics(spot_size(np.nan_to_num(darkness)), 0.0, curve, np.array([sigma**2, growth]))


def _darkest(darkness: NDArray[np.float32]) -> float:
    """Darkness of endless exposure, as the darkest pixels of a piece of film suggest it."""
    return 1.1 * float(np.nanquantile(darkness, 1.0 - min(2e-4, 20.0 / darkness.size)))


def sections(rows: int, height: int) -> Iterator[tuple[int, int]]:
    """Pieces to look at, the likeliest first."""
    looked_at: list[int] = []
    for place in (*PLACES, *MORE_PLACES):
        first = int(np.clip(round(place * rows - 0.5 * height), 0, max(0, rows - height)))
        if all(abs(first - other) >= height // 2 for other in looked_at):
            looked_at.append(first)
            yield first, min(rows, first + height)


def probe(scan: OpenScan, emulsion: FilmEmulsion, count: int | None = None) -> Section | None:
    """The section that shows most traces, with optics (of a known spot the shear alone) fitted; None without one."""
    height, known = FIRST_ROWS, emulsion.spot > 0.0
    while True:
        tried: list[tuple[int, int]] = []
        read: list[Section] = []
        for first, stop in sections(scan.rows, height):
            whole = _whole(read, count)
            shown = len(whole) >= ENOUGH and max(map(_worth, whole))[1] > ENOUGH_ROWS**2
            if shown or (len(tried) >= len(PLACES) and (whole or count is None or not read)):
                break
            piece = shown_darkness(emulsion, scan, first, stop, np.nan)
            guess = emulsion if known else first_optics(piece, float(np.sqrt(emulsion.grain[0])))
            one = _read_askew(piece, first, guess, read[0].period if read else emulsion.swing, count)
            tried.append((first, stop))
            read += [] if one is None else [one]
        if read:
            break
        if height >= min(scan.rows, TALLEST):
            return None
        height *= 2
    section = refine(max(_whole(read, count) or read, key=_worth), fixed=known)
    for first, stop in tried if count is None else sections(scan.rows, height):
        if first == section.first or len(section.swings) == count:
            continue
        piece = shown_darkness(emulsion, scan, first, stop, np.nan)
        other = read_section(piece, first, section.optics, section.period, count, least=SURE)
        if other is not None and len(other.swings) > len(section.swings):
            section = other
    return section


def _whole(read: list[Section], count: int | None) -> list[Section]:
    """The sections that show as many traces as there are: where one is missing, two may have been taken for one."""
    return [each for each in read if count is None or len(each.swings) == count]


def _worth(section: Section) -> tuple[int, int]:
    """What a section tells of the curve: whether its open rows suffice, and those where traces turn, times those of
    steep strokes; where marks fall on all turning points, nothing of what is dark."""
    rows, traces, *_ = _open_rows(section, section.optics.spot)
    slope = np.abs(place_and_rate(section.states)[1])
    flat = slope[rows, traces] < FLAT * slope.max(axis=0)[traces]
    return min(rows.size, LEAST_ROWS), (1 + int(np.count_nonzero(flat))) * (1 + int(np.count_nonzero(~flat)))


def refine(section: Section, fixed: bool) -> Section:
    """Optics fitted to the section and it read anew, as a first curve misleads; if `fixed`, the shear alone."""
    optics, shown, pace = section.optics, 0.0, HIDDEN
    for turn in range(REFINEMENTS):
        before, last, shown = optics, shown, measure_shear(section)
        pace = 0.5 * pace if shown * last < 0.0 else pace  # too far
        optics = replace(optics, shear=optics.shear + pace * shown)
        if not fixed:
            optics = calibrate(section, optics)
        again, rough = None, optics if fixed else replace(optics, grain=np.maximum(optics.grain, [0.0, ROUGH]))
        if turn < ANEW:
            again = read_section(section.darkness, section.first, rough, section.period, None, least=SURE)
        if again is None or len(again.swings) < len(section.swings):
            again = follow_from(section.swings, section.darkness, section.first, rough, 1.0)
        section = again
        shape, shape_before = (
            np.log([each.spot, each.curve.darkest, each.curve.middle, each.curve.contrast]) for each in (optics, before)
        )
        if np.abs(shape - shape_before).max() < ALIKE and abs(optics.shear - before.shear) < SETTLED_SHEAR:
            break
    return replace(section, optics=optics)


def _read_askew(
    piece: NDArray[np.float32], first: int, guess: Optics, period: float | None, count: int | None
) -> Section | None:
    """A section read with the first of several ways the slit may stand to the rows that suits it, or the best."""
    seeds = find_swings(piece, first, guess.spot, float(np.sqrt(guess.grain[0])), period)
    read: list[Section] = []
    for askew in ASKEW:
        section = read_section(piece, first, replace(guess, shear=guess.shear + askew), period, count, seeds)
        if section is not None:
            read.append(section)
            if section.share.min() >= UPRIGHT:
                break
    return max(read, key=lambda each: float(each.share.sum()), default=None)


def calibrate(section: Section, optics: Optics) -> Optics:
    """Spot, curve and grain fitted to a section, outliers weighed down; those given where it says too little."""
    rows, traces, lamp, typical = _open_rows(section, optics.spot)
    if rows.size < LEAST_ROWS:
        return optics
    states = section.states[rows].copy()
    read = section.place[:, rows].T
    states[:, :, 0] += np.where(np.isfinite(read), read - place_and_rate(states)[0], 0.0)

    def model(unknowns: Floats) -> tuple[Floats, Floats]:
        spot, *shape = np.exp(unknowns[:SHAPE])
        lamps = lamp * np.exp([0.0, *unknowns[SHAPE:]])
        exposure, pixels = _exposures(section.darkness, rows, traces, states, lamps, spot, optics.spot, optics.shear)
        return ToneCurve(*shape).darkness(exposure), pixels

    grain = optics.grain
    curve = optics.curve
    # lamps beside the first's: at other slopes, the curve before showed them too bright or too faint
    usual = np.append(np.log([optics.spot, _darkest(section.darkness), 1.0, *USUAL]), np.zeros(len(section.swings) - 1))
    unknowns, prior = usual.copy(), np.append(PRIOR_SIGMA, np.full(len(section.swings) - 1, LAMPS))
    unknowns[:SHAPE] = np.log([optics.spot, curve.darkest, curve.middle / typical, curve.contrast, curve.shoulder])
    for _ in range(ROUNDS):
        dark, pixels = model(unknowns)
        residual = np.nan_to_num(pixels - dark)  # beside what is hidden
        weight = 1.0 / (grain[0] + grain[1] * dark)
        size = np.abs(residual) * np.sqrt(weight)
        weight = weight * np.where(size > HUBER, HUBER / np.maximum(size, 1e-9), 1.0)
        jacobian = np.stack([(model(unknowns + each)[0] - dark) / 1e-4 for each in 1e-4 * np.eye(prior.size)], axis=1)
        normal = jacobian.T @ (weight[:, None] * jacobian) + np.diag(1e-3 + prior**-2)
        right = jacobian.T @ (weight * residual) + (usual - unknowns) / prior**2
        step = np.linalg.solve(normal, right)
        if unknowns[SHAPE - 1] + step[SHAPE - 1] < 0.0:  # no shoulder is softer than a hyperbola's
            unknowns[SHAPE - 1] = step[SHAPE - 1] = 0.0
            others = np.delete(np.arange(prior.size), SHAPE - 1)
            step[others] = np.linalg.solve(normal[np.ix_(others, others)], right[others])
        unknowns = unknowns + step * min(1.0, 0.3 / float(np.max(np.abs(step))))
        grain = _grain(residual, dark, float(optics.grain[0]))
        if float(step @ normal @ step) < SETTLED:
            break
    spot, *shape = (float(each) for each in np.exp(unknowns[:SHAPE]))
    return replace(optics, spot=spot, curve=ToneCurve(*shape), grain=grain)


@making_kernel
def _exposures(
    darkness: NDArray[np.float32], rows: NDArray[np.int64], traces: NDArray[np.int64], states: Floats, lamp: Floats,
    spot: float, window_spot: float, shear: float,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Modelled exposure and darkness about `rows` of `traces` (n,), windows by `window_spot`; lamp 0: left out."""
    columns = darkness.shape[1]
    exposure, dark = np.zeros((2, rows.size * columns))
    nodes, gaps, count = np.empty((3, MOST_NODES)), np.empty((0, 2)), 0
    for n in range(rows.size):
        number = nodes_of(states[n, traces[n]], window_spot, shear, gaps, 0.0, nodes)
        low, high = lit_columns(nodes, number, 0.01 * nodes[1, number // 2])
        first, stop = max(0, int(low - 4.0 * window_spot)), min(columns, int(high + 4.0 * window_spot))
        size = stop - first
        if size < 4:
            continue
        out = np.empty((3, size))
        dark[count : count + size] = darkness[rows[n], first:stop]
        for k in range(states.shape[1]):
            if lamp[n, k] > 0.0:
                number = nodes_of(states[n, k], spot, shear, gaps, 0.0, nodes)
                profile(nodes, number, 0.0, 0.0, spot, first, out)
                exposure[count : count + size] += lamp[n, k] * out[0]
        count += size
    return exposure[:count], dark[:count]


def _grain(residual: Floats, dark: Floats, blank: float) -> Floats:
    """Variance of a pixel on blank film, and its growth with darkness, from what the fit leaves."""
    edges = np.quantile(dark, np.linspace(0.0, 1.0, 13))
    place = np.clip(np.searchsorted(edges, dark, side="right") - 1, 0, 11)
    parts = [place == i for i in range(12) if np.any(place == i)]
    spread = np.array([1.4826 * np.median(np.abs(residual[part])) for part in parts])
    middle = np.array([dark[part].mean() for part in parts])
    growth = float(np.sum((spread**2 - blank) * middle) / max(float(np.sum(middle**2)), 1e-12))
    return np.array([blank, bounded_growth(growth, blank)])


def _open_rows(section: Section, spot: float) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats, float]:
    """Rows and traces away from gaps and other traces: with the lamp's brightness there for all, and its median."""
    half = max(4, round(0.25 * section.period))
    lamp = np.stack([_running_median(light, half) for light in section.brightness])
    place, slope = (each.T for each in place_and_rate(section.states))
    share = np.nan_to_num(section.brightness / lamp)
    for each, lean in zip(share, slope, strict=True):  # a curve that is wrong shows in the brightness by slope
        order = np.argsort(lean)
        each[order] /= np.maximum(median_filter(each[order], ALIKE_ROWS), 0.1)
    doubtful = ~np.isfinite(section.place) | (share < LACKING)
    hidden = np.isnan(section.darkness).any(axis=1)  # which takes no light from the rows beside
    near = doubtful | maximum_filter1d(doubtful & ~hidden, 2 * NEAR_GAP + 1, mode="constant")
    reach = spot * (6.0 + 5.0 * np.abs(slope))
    rows = []
    for k in range(len(place)):
        apart = ~near | (np.abs(place - place[k]) > reach + reach[k])
        apart[k] = ~near[k]
        chosen = np.flatnonzero(apart.all(axis=0))
        rows.append(chosen[np.linspace(0, chosen.size - 1, min(chosen.size, MOST_ROWS)).astype(int)])
    at, traces = np.concatenate(rows), np.repeat(np.arange(len(rows)), [each.size for each in rows])
    light = np.where(np.isfinite(section.states[at, :, 0]), lamp[:, at].T, 0.0)
    typical = max(float(np.median(light[np.arange(at.size), traces])) if at.size else 1.0, 1e-6)
    return at, traces, light / typical, typical


def _running_median(light: Floats, half: int) -> Floats:
    """Median of what is known within `half` rows."""
    wide = np.lib.stride_tricks.sliding_window_view(np.pad(light, half, constant_values=np.nan), 2 * half + 1)
    ordered = np.sort(wide, axis=1)  # NaN last
    count = np.isfinite(ordered).sum(axis=1)
    return np.where(count > 0, ordered[np.arange(light.size), np.maximum(count - 1, 0) // 2], 1.0)


def measure_shear(section: Section) -> float:
    """Rows by which the image lags per column, from the readings' second harmonic; 0 where the section is too short.

    With the slit askew by k rows a column, x(r) = A cos(w (r - k x)) = A cos(wr) + k w A^2/2 sin(2 wr) + ...
    """
    values, weights = [], []
    for state, place in zip(section.states.transpose(1, 0, 2), section.place, strict=True):
        rows = np.flatnonzero(np.isfinite(place) & np.isfinite(state[:, 0]))
        frequency = float(np.median(state[rows, 5])) if rows.size else 0.0
        if frequency <= 0.0 or rows.size < SHEAR_SWINGS * 2.0 * np.pi / frequency:
            continue
        state = state[rows]
        angle = np.arctan2(state[:, 4], state[:, 3])
        amplitude = float(np.median(np.hypot(state[:, 3], state[:, 4])))
        slope = place_and_rate(state)[1]
        t = (rows - rows.mean()) / (0.5 * rows.size)
        slow = np.polynomial.polynomial.polyvander(t, max(3, int(rows.size * frequency / np.pi)))
        co, si = np.cos(angle), np.sin(angle)
        columns = np.column_stack([np.sin(2 * angle), np.cos(2 * angle), slow, co, co * t, si, si * t])
        weight = 1.0 / np.sqrt(1.0 + slope**2)
        weighted = columns * weight[:, None]
        normal = weighted.T @ weighted + 1e-9 * np.eye(columns.shape[1])
        answer = np.linalg.solve(normal, weighted.T @ ((place[rows] - state[:, 0]) * weight))
        values.append(2.0 * answer[0] / (frequency * amplitude**2))
        weights.append((frequency * amplitude**2) ** 2 * rows.size)
    return float(np.average(values, weights=weights)) if values else 0.0
