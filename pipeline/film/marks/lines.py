"""Marks that lie not in the traces but beside them: lines across the film, dark or bright, and ticks at its edge.

Film that no trace sweeps shows them, as each row's median over groups of columns. The slant under which most groups
agree is the shear; what they share, row by row, is the light of the marks, and every peak of it is fitted.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.film.marks.alignment import Gaps

Light = Callable[[int, int], NDArray[np.float32]]  # of the rows between two, (rows, columns): darkness or exposure
NONE = "film: no marks beside the traces were found; check that the film bears them, or state another mark_kind"
GROUP, TICK, LEAST = 32, 4, 4  # columns of a group, for lines across and for ticks; fewest groups
WIDE = 8  # groups that are looked at together at first; of a narrow film half of all
PLACES, ROWS = 7, 1024  # sections that are looked at first, and rows in each
STANDS_OUT, FAINT_DARK, FAINT_BRIGHT = 8.0, 0.02, 0.01  # of a peak: sigmas, and darkness, of dark and of bright ones
FEWEST, AS_MANY = 3, 0.8  # peaks in a section; share of the dark ones that are as many, of bright ones, or reversed
MOSTLY = 0.6  # of groups or sections, that show marks
STEEPEST, STEP, SEARCHED = 0.035, 0.00125, 6000  # tangents of the shear, up to 2 degrees, and rows by which it is found
ALIKE = 0.7  # correlation with the others, of a group that shows the marks
ROUNDS = 4
USUAL, ODD = 0.3, 1.4  # of a usual mark's height: of a peak that is one; and from which more than a mark lies there
DIP = 0.1  # the same, of what lies lower between two marks
NEIGHBOURS, BROADER = 31, (0.06, 0.8)  # marks; by how much more light one that hides a stand of the paper has
LAGS, PAD = 32, 24  # of a row, in which lags of lines are drawn; rows on either side, for the spline
REACH = 1.5  # breadths of a mark, within which its light lies
BLIND = 0.01  # darkness of a line, from which what lies on it is not read: it does not add to the darkness of others
ALONE = 0.75  # of the usual distance, from which marks are fitted one by one
NARROWEST, NEAR, FULL = 0.6, 4.0, 2.355  # rows, of a mark's sigma; of it, fitted about a peak, and in a breadth
Rows = NDArray[np.int64]


class NoMarksError(RefusedError):
    """No marks lie beside the traces."""


class Lines(NamedTuple):
    """Light of the marks beside the traces."""

    kind: str  # "dark-lines", "bright-lines" or "edge"
    light: Floats  # (rows,), where the marks' lines cross column 0: what marks have more of, of bright ones the lack
    usual: Floats  # the same of usual marks alone: where more light fell, the paper stood
    noise: float  # 1 sigma of it
    shear: float  # rows by which the image lags per column
    shear_sigma: float

    def over(self, first: int, rows: int, columns: int) -> NDArray[np.float32]:
        """Darkness that the marks add on some rows from `first` on, (rows, columns)."""
        from scipy.ndimage import map_coordinates, spline_filter1d

        lag, which = np.unique(np.round(self.shear * (np.arange(columns) + 0.5) * LAGS) / LAGS, return_inverse=True)
        reach = int(np.abs(lag).max()) + PAD
        low, stop = max(first - reach, 0), min(first + rows + reach, self.usual.size)
        part = spline_filter1d(self.usual[low:stop], 3, mode="mirror")
        at = first - low + np.arange(rows)[:, None] - lag
        added = map_coordinates(part, [at], order=3, prefilter=False, mode="nearest")[:, which]
        return (-added if self.kind == "bright-lines" else added).astype(np.float32)

    def marks(self) -> tuple[Rows, Floats]:
        """Rows of the marks' peaks, and their breadths, rows, at half their height."""
        from scipy.signal import find_peaks, peak_widths

        least = max(STANDS_OUT * self.noise, FAINT_BRIGHT if self.kind == "bright-lines" else FAINT_DARK)
        top, found = find_peaks(self.light, height=least, prominence=0.5 * least)
        if top.size:  # noise on top of a broad mark makes no second one
            usual = float(np.median(self.light[top]))
            top = top[(self.light[top] > USUAL * usual) & (found["prominences"] > DIP * usual)]
        return top, peak_widths(self.light, top)[0]

    def cleared(self) -> "Lines":
        """The same above what is shown midway between marks, with what the usual marks' light is."""
        top, breadth = self.marks()
        light = self.light - (np.median(self.light[(top[1:] + top[:-1]) // 2]) if top.size > 1 else 0.0)
        usual = light[top] < ODD * np.median(light[top])
        near = np.zeros(self.light.size, dtype=bool)
        for row, wide in zip(top[usual], breadth[usual], strict=True):
            near[max(int(row - REACH * wide), 0) : int(row + REACH * wide) + 2] = True
        return self._replace(light=light, usual=np.where(near, np.maximum(light, 0.0), 0.0))


def lines_across(darkness: Light, rows: int, columns: int) -> Lines | None:
    """Lines from edge to edge, None where there are none; only a few sections are read of a film without."""
    groups = np.arange(columns // GROUP * GROUP).reshape(-1, GROUP)
    wide = min(WIDE, len(groups) // 2)
    if wide < LEAST:
        return None

    def show(first: int, stop: int) -> bool:
        each = medians(darkness, groups, first, stop)
        noise = noise_of(each, wide)
        signs = [shown(np.median(each[k : k + wide], axis=0), noise) for k in range(0, len(groups) - wide + 1, wide)]
        return max(signs.count(-1), signs.count(1)) > MOSTLY * len(signs)

    if np.mean([show(*piece) for piece in sections(rows)]) < MOSTLY:
        return None
    return _lined(darkness, groups, rows)


def ticks(light: Light, rows: int, free: Rows) -> Lines:
    """Marks on a strip of the columns `free`, which no trace sweeps; `RefusedError`: there are none."""
    runs = np.split(free, np.flatnonzero(np.diff(free) > 1) + 1)
    groups = np.concatenate([run[: run.size // TICK * TICK].reshape(-1, TICK) for run in runs])
    pieces = sections(rows)
    share = np.zeros(len(groups))
    for piece in pieces:
        each = medians(light, groups, *piece)
        share += [shown(own, noise_of(each, 1)) != 0 for own in each]
    marked = np.flatnonzero(share > MOSTLY * len(pieces))
    beside = np.split(marked, np.flatnonzero(np.diff(groups[marked, 0]) > TICK) + 1)
    best = max(beside, key=len)
    found = _lined(light, groups[best], rows) if best.size >= LEAST else None
    if found is None:
        raise NoMarksError(NONE)
    return found._replace(kind="edge")


def sections(rows: int) -> list[tuple[int, int]]:
    """Some pieces of a film, first row and that behind the last."""
    height = min(rows, ROWS)
    return [(first, first + height) for first in np.unique(np.linspace(0, rows - height, PLACES).astype(int)).tolist()]


def medians(light: Light, groups: Rows, first: int, stop: int) -> NDArray[np.float32]:
    """Median of each row in each group of columns, (groups, rows)."""
    return np.asarray(np.median(light(first, stop)[:, groups], axis=2).T, dtype=np.float32)


def noise_of(each: NDArray[np.floating], number: int) -> float:
    """1 sigma of the median of a `number` of groups (groups, rows), by how neighbours differ: they share the marks."""
    apart = np.diff(each, axis=0)
    one = 1.4826 * np.median(np.abs(apart - np.median(apart, axis=1, keepdims=True)), axis=1) / np.sqrt(2.0)
    return float(np.median(one) * np.sqrt(0.5 * np.pi / number))


def shown(light: NDArray[np.floating], noise: float) -> int:
    """Whether rows with 1 sigma of `noise` show some peaks, dark (1) or bright (-1), or none (0)."""
    away = light - np.median(light)
    shown_by = (away > max(STANDS_OUT * noise, FAINT_DARK), -away > max(STANDS_OUT * noise, FAINT_BRIGHT))
    counts = [int(np.count_nonzero(np.diff(peaks.astype(np.int8)) > 0)) for peaks in shown_by]
    if min(counts) >= max(FEWEST, AS_MANY * max(counts)):  # film midway between dark marks is brighter than beside them
        return 1 if away.max() >= -away.min() else -1
    return 0 if max(counts) < FEWEST else 1 if counts[0] >= counts[1] else -1


def _lined(light: Light, groups: Rows, rows: int) -> Lines | None:
    """What groups of columns share along the film's slant, None where too few share any peaks."""
    from scipy.ndimage import shift

    each = np.concatenate([medians(light, groups, at, min(at + ROWS, rows)) for at in range(0, rows, ROWS)], axis=1)
    each -= np.median(each, axis=1, keepdims=True)
    column, begin = groups.mean(axis=1) + 0.5, max(rows - SEARCHED, 0) // 2

    def slanted(shear: float, part: slice = slice(None)) -> Floats:
        return np.stack([shift(own[part], -shear * c, mode="nearest") for c, own in zip(column, each, strict=True)])

    tried = np.arange(-STEEPEST, STEEPEST + 1e-9, STEP)
    shared = [np.median(slanted(tan, slice(begin, begin + SEARCHED)), axis=0) for tan in tried]
    shear, error = float(tried[np.argmax(np.square(shared).mean(axis=1))]), 0.0
    for _ in range(ROUNDS):
        shifted = slanted(shear)
        common = np.median(shifted, axis=0)
        steep = np.gradient(common)
        alike = shifted @ common > ALIKE * np.linalg.norm(shifted, axis=1) * np.linalg.norm(common)
        if alike.sum() < LEAST:
            return None
        lag = (common - shifted[alike]) @ steep / (steep @ steep)
        (slope, _), covariance = np.polyfit(column[alike], lag, 1, cov=True)
        shear, error = shear + float(slope), float(np.sqrt(covariance[0, 0]))
    common, noise = np.median(slanted(shear)[alike], axis=0), noise_of(shifted[alike], int(alike.sum()))
    sign = shown(common, noise)
    kind = "dark-lines" if sign > 0 else "bright-lines"
    return Lines(kind, sign * common, sign * common, noise, shear, error).cleared() if sign else None


def fitted(lines: Lines) -> Gaps:
    """All marks, each a Gaussian fitted to its peak and those near it; widths by their light, a usual mark's 1."""
    from scipy.optimize import least_squares

    top, breadth = lines.marks()
    if not top.size:
        raise NoMarksError(NONE)
    usual, found = max(float(np.median(breadth)) / FULL, NARROWEST), []
    apart = min(2.0 * NEAR * usual, ALONE * float(np.median(np.diff(top)))) if top.size > 1 else 0.0
    for near in np.split(np.arange(top.size), np.flatnonzero(np.diff(top) > apart) + 1):
        reach = NEAR * usual + breadth[near]
        begin = max(int(top[near[0]] - reach[0]), 0)
        part = lines.light[begin : int(top[near[-1]] + reach[-1]) + 2]
        start = np.concatenate([[0.0], *([row + 0.5, usual, usual * lines.light[row]] for row in top[near])])
        if part.size <= start.size:
            continue
        at = begin + np.arange(part.size) + 0.5

        def misfit(value: Floats, at: Floats = at, part: Floats = part) -> Floats:
            """Level, and row, sigma and light of each peak, against what is there, in sigmas."""
            row, wide, area = value[1:].reshape(-1, 3).T[:, :, None]
            shown = np.sum(area / wide * np.exp(-0.5 * ((at - row) / wide) ** 2), axis=0)
            return np.asarray((value[0] + shown - part) / lines.noise)

        fit = least_squares(misfit, start, method="lm")
        jacobian = np.asarray(fit.jac)
        excess = max(1.0, 2.0 * fit.cost / (part.size - start.size))
        sigma = np.sqrt(excess * np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
        found += [(fit.x[k], sigma[k], abs(fit.x[k + 2]), sigma[k + 2]) for k in range(1, start.size, 3)]
    found = sorted(each for each in found if each[1] < usual and each[2] > 0.0)
    if not found:
        raise NoMarksError(NONE)
    row, sigma, light, light_sigma = np.array(found).T
    none, one = np.zeros(row.size), np.ones(row.size)
    width = light / np.median(light), light_sigma / np.median(light)
    return Gaps(none.astype(np.int64), row, sigma, none, none, none, *width, one, none, one, one)


def widened(marks: Gaps) -> Floats:
    """Rows of marks a little broader than those around: on a dark line a stand of the paper shows in no other way."""
    from scipy.ndimage import median_filter

    more = marks.width / median_filter(marks.width, NEIGHBOURS, mode="nearest") - 1.0
    return marks.row[(more > max(BROADER[0], STANDS_OUT * float(np.median(np.abs(more))))) & (more < BROADER[1])]
