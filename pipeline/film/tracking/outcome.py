"""Rows of a piece of film that was followed both ways: read, judged and flagged.

Gaps are estimated from a trace's brightness row by row, and fitted to the pixels. The spot blurs a gap, but not the
light that is missing: its sum over the rows is the gap's length, its centre of gravity the middle; a first guess.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import ndtr

from data_schemas.errors import RefusedError
from data_schemas.variables import ELONGATION_FLAGS
from pipeline.arrays import Floats
from pipeline.film.emulsion import FilmEmulsion, Optics
from pipeline.film.marks.gap_kernels import ROW, ROW_SIGMA, WIDTH, Known, fit_gaps
from pipeline.film.marks.search import grain
from pipeline.film.parts import Tracks
from pipeline.film.tracking.motion import place_and_rate
from pipeline.film.tracking.pieces import BOTH, Piece, combined
from pipeline.film.tracking.row_reading import read_piece

NOTHING = (
    "no swinging trace found on the film: lines that turn at regular intervals are looked for, dark on light, with rows"
    " running along time; check the orientation and polarity of the scan, or give period and traces (the dots of a lamp"
    " that flashes are not read)"
)
LEAST_READ = 0.15  # of the rows, and of the share of the best trace
UNLIKE = 8.0  # mean square residual, in units of the grain's, of more than a line
LEAST_LACK, SIGNIFICANT = 0.12, 6.0  # of a row's light, and sigma of the light missing in all, from which it is a gap
LATERAL, LENGTH_PRIOR = 0.1, 1.0  # px, 1 sigma of the course across the line; of the length
MOST_SIGMA = 0.5  # rows, of a fit that is believed
LEAST_OPEN = 0.7  # share of the light let through under which a row counts as lying in a gap
VISIBLE = 4.0
LEAST_LIGHT, MOST_LIGHT = 0.5, 1.8  # of the lamp's
PARTIAL, PARTIAL_SIGMA = 0.85, 3.0  # less light than that, and a part of the line is missing: it begins or ends there
CUT, CUT_SIGMA = 0.35, 3.0  # rows of light lacking beside each other, and sigma of it: the shutter closed there
CUT_ROWS, ABOUT = 3, 7
MISFIT = 4.0
OUTLIER = 4.5
FAR = 0.75  # spots off a course that is known: no reading of a faint line is worth that much doubt
STRANGE = 2.5  # sigma from which on two rows beside each other are both left out
COURSE_SLACK = 0.06  # spots
DISAGREEMENT = 6.0
WORST_NORMAL = 0.35  # spots: a reading no better than that is left out
SHARED = 1.5  # growth of the variance by other traces from which on a row is flagged
FLOOR = 0.006  # spots, of the normal: what model and calibration leave
BESIDE, WHOLE, STEEP = 0.018, 0.995, 3.0  # the same beside a gap, more where the line turns, which hides its ends
LOST_SWINGS = 0.3  # without a reading on either side
MARGIN_SPOTS, WINGS = 16, 0.8  # of gaps, beyond a piece; of dark marks


def read_both(
    emulsion: FilmEmulsion, optics: Optics, period: float, tracks: Tracks, misfit: NDArray[np.float32], first: int,
    darkness: NDArray[np.float32], forth: Piece, back: Piece, above: int, light: Floats,
) -> None:  # fmt: skip
    """Fill the piece's rows of `tracks` and `misfit`; `light` (traces, more rows) begins `above` rows before them."""
    rows = len(darkness)
    course = combined(forth, back, optics.spot, optics.shear)
    states, known = course.states, course.known > 0
    place, rate = (np.where(known, each.T, np.nan) for each in place_and_rate(states))
    bend = (states[:, :, 2] - states[:, :, 5] ** 2 * states[:, :, 3]).T
    gain = 1.0 + optics.shear * rate
    slope = rate / gain
    margin = round(MARGIN_SPOTS * optics.spot)
    low, high = max(0, above - margin), min(light.shape[1], above + rows + margin)
    lamps = np.stack([lamp_course(each, period) for each in light])
    across = emulsion.blank.across
    marked = across is not None and across.kind == "dark-lines"  # and no shutter closes
    gaps = [
        np.empty((0, 2)) if marked else find_gaps(each[low:high], lamp[low:high], first - above + low)
        for each, lamp in zip(light, lamps, strict=True)
    ]
    gaps = fitted_gaps(darkness, first, place, slope, gaps, emulsion, period)
    gap_of = np.concatenate([[0], np.cumsum([len(each) for each in gaps])])
    part, inside = slice(first, first + rows), slice(above, above + rows)
    lamp = np.ascontiguousarray(lamps[:, inside])
    reading = read_piece(
        darkness, first, states, course.known, course.slope_variance, lamp, np.concatenate(gaps), gap_of, optics.lens
    )
    reading[:, :, 1::4] *= emulsion.clumped(np.nan_to_num(slope))[:, :, None]  # both variances of the shift
    column = np.clip(np.nan_to_num(place), 0, darkness.shape[1] - 1).astype(int)
    black = darkness[np.arange(rows), column] > emulsion.blackest
    for k in range(len(gaps)):
        share = openness(gaps[k], first, rows, optics.spot)
        tracks.position[k, part], tracks.sigma[k, part], tracks.qc[k, part] = judge(
            reading[k], place[k], course.variance[k], course.disagreement[k], course.known[k], share, lamp[k], black[k],
            optics, None if across is None else across.kind,
        )  # fmt: skip
    tracks.course[:, part], tracks.slope[:, part], tracks.curvature[:, part] = place, slope, bend / gain**3
    tracks.brightness[:, part] = np.where(known, light[:, inside] / lamp, np.nan)
    misfit[:, part] = np.where(known, reading[:, :, 4], np.nan)


def lamp_course(light: Floats, period: float) -> Floats:
    """Brightness of the line in the open: the running upper half of half a swing, where anything is seen."""
    width = 2 * max(4, round(0.25 * period)) + 1
    course = ndimage.percentile_filter(np.nan_to_num(light, nan=0.0), 60.0, size=width, mode="nearest")
    return np.asarray(np.maximum(course, 0.02), dtype=np.float64)


def find_gaps(light: Floats, lamp: Floats, first: int) -> Floats:
    """First and last row of a trace's gaps (n, 2) from its brightness from row `first` on; NaN where not followed."""
    lack = np.clip(1.0 - light / lamp, -0.5, 1.0)
    known = np.isfinite(lack)
    sigma = 1.4826 * float(np.median(np.abs(lack[known] - np.median(lack[known])))) if known.sum() > 8 else 0.1
    lack = np.where(known, lack, 0.0)
    inside = ndimage.uniform_filter1d(lack, 3, mode="constant") > max(LEAST_LACK, 2.0 * sigma)
    gaps = []
    for (dim,) in ndimage.find_objects(ndimage.label(inside)[0]):
        a, b = max(0, dim.start - 1), min(lack.size, dim.stop + 1)
        amount = float(lack[a:b].sum())
        if amount > max(0.2, SIGNIFICANT * sigma * np.sqrt(b - a)):
            middle = first + float(np.sum(lack[a:b] * (np.arange(a, b) + 0.5))) / amount
            gaps.append((middle - 0.5 * amount, middle + 0.5 * amount))
    return np.array(gaps).reshape(-1, 2)


def fitted_gaps(
    darkness: NDArray[np.float32], first: int, place: Floats, slope: Floats, gaps: list[Floats], emulsion: FilmEmulsion,
    period: float,
) -> list[Floats]:  # fmt: skip
    """Gaps of all traces, first and last rows (n, 2), fitted to film from row `first` on; as given where it fails."""
    table, exposure = np.concatenate(gaps) - first, emulsion.lit(np.nan_to_num(darkness))
    trace = np.repeat(np.arange(len(gaps)), [len(each) for each in gaps])
    known = Known(emulsion.spot, emulsion.shear, *grain(emulsion), LATERAL, LENGTH_PRIOR, 0.5 * period)
    result = fit_gaps(exposure, 0, place, slope, trace, table.mean(axis=1), table[:, 1] - table[:, 0], known)
    good = result[:, ROW_SIGMA] < MOST_SIGMA
    table[good] = result[good, ROW, None] + result[good, WIDTH, None] * np.array([-0.5, 0.5])
    return [first + table[trace == k] for k in range(len(gaps))]


def openness(gaps: Floats, first: int, rows: int, spot: float) -> Floats:
    """Share of a trace's light that the shutter let through to each row; `gaps` (n, 2) are first and last rows."""
    share = np.ones(rows)
    for middle, length in zip(gaps.mean(axis=1), gaps[:, 1] - gaps[:, 0], strict=True):
        a, b = np.clip(middle - first + np.array([0, 1]) + (length + 5 * spot) * np.array([-1, 1]), 0, rows).astype(int)
        away = first + np.arange(a, b) + 0.5 - middle
        share[a:b] -= ndtr((away + 0.5 * length) / spot) - ndtr((away - 0.5 * length) / spot)
    return share


def judge(
    reading: Floats, place: Floats, course_variance: Floats, disagreement: Floats, known: NDArray[np.uint8],
    open_share: Floats, lamp: Floats, black: NDArray[np.bool_], optics: Optics, across: str | None,
) -> tuple[Floats, Floats, NDArray[np.uint16]]:  # fmt: skip
    """Position and sigma of one trace's rows, NaN where not accepted, and their flags.

    `reading` is that of `row_reading.read_piece`, the course that of `pieces.combined`; `lamp` is the brightness in the
    open, and `black` says where the film can be no darker. `across`: kind of the marks across the film; on dark ones
    nothing is read, and bright ones may shade whole rows of a trace's light, or some of its time.
    """
    marked = across == "dark-lines"
    shift, variance, light, light_variance, misfit, alone, slope = reading.T
    light_variance = np.where(light_variance > 0.0, light_variance, np.inf)  # what lies there is no line
    stretch = 1.0 + slope**2
    followed = known > 0
    whole = np.maximum(LEAST_LIGHT * lamp, PARTIAL * lamp - PARTIAL_SIGMA * np.sqrt(light_variance))
    # beside what is hidden a gap is not seen whole, and a dark mark's wings lie on the line
    hidden, margin = followed & np.isnan(light), int((WINGS if marked else MARGIN_SPOTS) * optics.spot)
    followed = followed & ~ndimage.binary_dilation(hidden, np.ones(2 * margin + 1, bool))
    visible = followed & (light > VISIBLE * np.sqrt(light_variance)) & (light > whole)
    light_spread = _usual(light_variance, followed) / lamp**2
    visible &= (light > PARTIAL * lamp) | ~_cut(1.0 - light / lamp, light_spread, followed)
    beside = open_share < WHOLE
    gap = followed & ((open_share < LEAST_OPEN) | (beside & ((np.abs(slope) < STEEP) | (across == "bright-lines"))))
    unsure = followed & (disagreement > DISAGREEMENT)
    shared = followed & (variance > SHARED * alone)
    spread = np.where(shared, variance, np.minimum(variance, _usual(alone / stretch, followed) * stretch))
    allowed = spread + course_variance + (COURSE_SLACK * optics.spot) ** 2 * stretch
    strange = shift**2 > STRANGE**2 * allowed
    dim = 1.0 - light / lamp > STRANGE * np.sqrt(light_spread)
    rejected = misfit > MISFIT * _usual_misfit(misfit, followed, np.abs(slope) < STEEP)
    rejected |= (shift**2 > OUTLIER**2 * allowed) | (light > MOST_LIGHT * lamp)
    rejected |= shift**2 > (FAR * optics.spot) ** 2 * stretch + OUTLIER**2 * course_variance
    rejected |= strange & ndimage.binary_dilation(followed & ~gap & (strange | dim), [True, False, True])
    rejected |= variance > WORST_NORMAL**2 * optics.spot**2 * stretch
    accepted = visible & ~gap & ~unsure & ~rejected & ~black
    qc = np.zeros(shift.size, dtype=np.uint16)
    for name, rows in {
        "gap": gap,
        "saturated": black,
        "ambiguous": unsure,
        "overlap": shared,
        "single_direction": known != BOTH,
        "outlier": ~gap & ~shared & ~accepted & ~unsure & ~black,
    }.items():
        qc[followed & rows] |= ELONGATION_FLAGS[name]
    qc[hidden & marked] = ELONGATION_FLAGS["gap"]
    floor = np.where(beside, BESIDE * (1.0 + 2.0 * STEEP / np.maximum(np.abs(slope), STEEP)), FLOOR) * optics.spot
    sigma = np.sqrt(variance * np.maximum(1.0, misfit) + floor**2 * stretch)
    return np.where(accepted, place + shift, np.nan), np.where(accepted, sigma, np.nan), qc


def _usual(variance: Floats, followed: NDArray[np.bool_]) -> Floats:
    """Variance of readings of whole lines about each row: that of a row cut by the shutter is too large, not wrong."""
    good = followed & np.isfinite(variance)
    usual = float(np.median(variance[good])) if good.any() else 0.0
    return np.asarray(ndimage.median_filter(np.where(good, variance, usual), ABOUT))


def _usual_misfit(misfit: Floats, followed: NDArray[np.bool_], turning: NDArray[np.bool_]) -> Floats:
    """Of rows alike, where the line turns and elsewhere, at least 1: grain may be finer than a line's model."""
    of_each = (misfit[followed & np.isfinite(misfit) & (turning == there)] for there in (False, True))
    steep, turn = (float(np.median(each)) if each.size else 1.0 for each in of_each)
    return np.asarray(np.where(turning, max(turn, 1.0), max(steep, 1.0)))


def _cut(lack: Floats, variance: Floats, followed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which rows lie where light is lacking on rows beside each other: a gap too faint to be found as one."""
    ends = np.ones(CUT_ROWS)
    total, spread = np.convolve(np.where(followed, lack, 0.0), ends), np.convolve(variance, ends)
    lacking = total > np.maximum(CUT, CUT_SIGMA * np.sqrt(spread))
    return np.asarray(np.any([lacking[k : k + lack.size] for k in range(CUT_ROWS)], axis=0))


def flag_lost(position: Floats, course: Floats, qc: NDArray[np.uint16], period: float, some: slice) -> None:
    """Where a trace was followed on some rows without being read for long it is lost: course NaN, in place."""
    size = 2 * max(4, round(LOST_SWINGS * period)) + 1
    lost = ~np.isfinite(course) | ~ndimage.maximum_filter1d(np.isfinite(position), size, mode="constant")
    lost[..., : some.start], lost[..., some.stop :] = False, False
    course[lost] = np.nan
    qc[lost] = ELONGATION_FLAGS["lost"]


def checked(out: Tracks, misfit: NDArray[np.float32], unlike: float = 0.0) -> Tracks:
    """The traces, if trusted by `misfit` (traces, rows), in units of grain's, or of `unlike`, where grain is finer than
    a line's model; `RefusedError`: one is no line or hardly read, two are one."""
    most = UNLIKE * max(1.0, unlike)
    for trace, each in enumerate(misfit):
        known = each[np.isfinite(each)]
        if known.size and (usual := float(np.quantile(known, 0.75))) > most:
            raise RefusedError(
                f"trace {trace + 1} of the film does not look like one line: on a quarter of its rows the mean"
                f" square residual is over {usual:.1f} times the grain's, at most {most:.3g} is allowed; another"
                " trace may lie on it: give count, or cut the film where it can be read"
            )
    read = np.isfinite(out.position).mean(axis=1)
    if read.max() < LEAST_READ:
        raise RefusedError(NOTHING)
    worst = int(np.argmin(read))
    if read[worst] < LEAST_READ * read.max():
        raise RefusedError(
            f"trace {worst + 1} of the film was found but read on {100.0 * read[worst]:.0f} % of the rows only, the"
            f" best on {100.0 * read.max():.0f} %: scan again, cut the film where it can be read, or give count"
        )
    for b, a in combinations(range(len(out.course)), 2):
        away = np.abs(out.course[a] - out.course[b]) / np.sqrt(1.0 + out.slope[a] ** 2)
        away = away[np.isfinite(away)]
        if away.size and float(np.mean(away < out.spot)) > 0.5:
            raise RefusedError(
                f"traces {b + 1} and {a + 1} of the film lie on each other on more than half of the rows: give"
                " count, or cut the film where they lie apart"
            )
    return out
