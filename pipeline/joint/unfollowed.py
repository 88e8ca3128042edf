"""What acts on gravity unread: motion that is too fast or too weak to be followed, or lies in gaps; rounding.

The path that is likeliest leaves out the variance about it. Vertical motion zeta at x times the swing's frequency slows
a pendulum by <zeta^2> / (4 - x^2) of gravity, horizontal motion u stiffens it by <u^2> (r - r^2 / 2), r = 1 / (1 -
x^2): slow motion by <zeta^2> / 4 and <u^2> / 2, Browne's terms; fast horizontal motion slows it by <u^2> / x^2.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds
from pipeline.joint.constants import Constant, Constants, total
from pipeline.joint.course import IN_GAP
from pipeline.joint.explanation import Fitted, angles, attempted, fitted
from pipeline.joint.film_errors import swing_of
from pipeline.joint.lattice import LONG_GAP
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Sea, density
from pipeline.joint.whiteness import CALM, Spectrum, beside_the_swing, transfer

FASTEST, PLACES = 60.0, 4000  # rad s-1, of a spectrum's even places; their number
WIDTHS = np.sinh(np.linspace(-6.0, 6.0, 121))  # of a component, at which places lie about its peak
NEAR_TWICE = 0.05  # of (2 n)^2: so near it the swing's own width keeps the term finite
DOUBTED = 0.5  # share of the term that the assumed spectrum leaves uncertain
LEAST_MODES = 0.5
SHORT = (0.6, 0.8, 1.0, 1.25)  # of the swing's frequency, of short waves
BROAD = 0.3  # of theirs, a width
LIFTS = np.geomspace(0.1, 10.0, 9)  # of what sways a ship so fast, what lifts it: planes of swing face any way
ALIASED = 2.5  # times the swing's frequency: readings that do not resolve it alias the harmonics
SHORTEST = 2.0  # s: nothing hides in shorter gaps
MOST_GAPS, SPREAD = 30, 4.0  # at most; of a knot's width, all of it, which is so much over its mean
HALF_FORETOLD = 20.0  # s: half of what happens in so long a gap is foretold
NEAR = 0.2  # of a square of frequencies: closer to resonance motion has no steady response
INDEPENDENT = 10.0  # s, after which a swell's square is another one


def unresolved(fit: Fitted, assumed: Assumed) -> tuple[float, float]:
    """Gravity over itself to be added for vertical motion not followed, and its 1 sigma: by the assumed spectrum, less
    what its sidebands beside the swing of a fit show above noise and horizontal motion."""
    problem = fit.model.problem
    upright = [each for each in assumed.ship if each.axis == "vertical"]
    if not upright or not problem.leaves_heave_open(assumed.sine):
        return 0.0, 0.0
    swing, lattice = problem.swing, problem.lattice
    about = [each.peak + getattr(each, "damping", each.peak) * WIDTHS for each in upright]
    frequency = np.unique(np.concatenate([np.linspace(0.01, FASTEST, PLACES), *about]))
    frequency = frequency[frequency > 0.0] * (1.0 + 1e-9)  # never twice the swing's own
    whole = density(assumed.ship, frequency, "vertical")
    shown = np.zeros(frequency.size)  # signal over noise, of all sidebands
    for trace, spacing in enumerate(lattice.spacing[: problem.traces]):
        swings = fit.path[:, : 2 * problem.pendulums : 2] @ lattice.combination[trace]
        for by in (swing, -swing):
            beside = np.abs(frequency + by)
            level = transfer(problem, lattice.combination[trace], beside) * density(assumed.ship, beside, "horizontal")
            signal = beside_the_swing(swing, swings, beside) * whole
            shown += signal / (level + assumed.noise[trace] ** 2 * spacing)
    recorded = lattice.time[lattice.trace == problem.traces + 1]
    if recorded.size > 1:
        step = float(np.median(np.diff(recorded)))
        shown += np.where(frequency < np.pi / step, whole / (assumed.noise[problem.traces + 1] ** 2 * step), 0.0)
    away = 1.0 - frequency**2 / (4.0 * swing**2)
    left = whole / (1.0 + shown) * 0.25 * away / (away**2 + NEAR_TWICE**2)
    size, square = np.trapezoid(np.abs(left), frequency), np.trapezoid(left**2, frequency)
    if not size:
        return 0.0, 0.0
    modes = max(lattice.duration / (2.0 * np.pi) * size**2 / square, LEAST_MODES)
    return float(np.trapezoid(left, frequency)) / np.pi, float(size) / np.pi * float(np.hypot(DOUBTED, modes**-0.5))


def short_waves(fit: Fitted) -> tuple[float, float]:
    """The same for short waves that lift a ship as it sways so fast, too weak to be found: all sizes from a tenth of
    what sways it to tenfold are as likely beforehand; the errors weigh them."""
    assumed, problem = fit.model.assumed, fit.model.problem
    sways = [each for each in assumed.ship if each.axis == "horizontal" and each.peak > CALM * problem.swing]
    if not sways or not problem.leaves_heave_open(assumed.sine):
        return 0.0, 0.0
    size, spectrum = float(np.hypot.reduce([each.rms for each in sways])), Spectrum.of(fit)
    own, trials = unresolved(fit, assumed)[0], []
    for frequency in problem.swing * np.array(SHORT):
        for rms in size * LIFTS:
            waves = Sea(float(frequency), BROAD * float(frequency), float(rms), "vertical")
            lifted = replace(assumed, ship=(*assumed.ship, waves))
            more, doubt = unresolved(fit, lifted)
            trials.append((spectrum.gain(lifted), more - own, doubt))
    gain, more, doubt = np.transpose(trials)
    share = np.exp(gain - gain.max())
    share /= share.sum()
    mean = float(share @ more)
    return mean, float(np.sqrt(max(share @ (more**2 + doubt**2) - mean**2, 0.0)))


def change_in_gaps(fit: Fitted, gravity: Floats) -> tuple[float, float]:
    """Change of mean gravity over reference gravity by motion in gaps, and its 1 sigma; 0 of linear pendulums. The
    likeliest path fades in a gap, or goes on with a motion that is not the ship's. The mean square outside tells what
    it is there; a fit with that as a known change, what gets into the mean. `gravity`: its row, (c,)."""
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    if not fit.model.assumed.sine or lattice.longest_gap < SHORTEST:
        return 0.0, 0.0
    changes, apart = _changes(fit), lattice.apart
    inside = apart > SHORTEST
    if not inside.any() or inside.all():
        return 0.0, 0.0
    level, hidden = float(np.abs(changes).sum(axis=0)[~inside].mean()), apart / (apart + HALF_FORETOLD) * inside
    if level <= 0.0:
        return 0.0, 0.0
    track = (level * hidden)[:, None] + (problem.track if problem.track.size else np.zeros(1))
    whole = _change(fit, gravity, replace(problem, track=track))
    change = changes.sum(axis=0)
    missed = float(change[~inside].mean() - change[inside].mean()) / level
    squares = max(float(inside.sum()) * lattice.step / INDEPENDENT, 1.0)
    return whole * missed, abs(whole) * float(np.sqrt(0.5 / squares))


def gaps(fit: Fitted) -> Constants:
    """What acts as gravity does in each long gap, where nothing shows it: 1 sigma is what motion does elsewhere, or on
    either side of it, if that is more, as in a turn of the ship."""
    lattice, time = fit.model.problem.lattice, fit.model.problem.lattice.read
    if not fit.model.assumed.sine or lattice.longest_gap < LONG_GAP:
        return ()
    longest = np.argsort(-np.diff(time))[:MOST_GAPS]
    changes, shown = np.abs(_changes(fit)).sum(axis=0), lattice.apart < SHORTEST
    nodes, out = lattice.step * np.arange(lattice.nodes), list[Constant]()
    for begin, end in np.stack([time[longest], time[longest + 1]], axis=-1).tolist():
        if end - begin > LONG_GAP:
            beside = [shown & (np.abs(nodes - edge) < INDEPENDENT) for edge in (begin, end)]
            size = SPREAD * max(float(changes[each].mean()) for each in (shown, *beside) if each.any())
            name, middle, width = f"{IN_GAP} at {begin:.0f} s", 0.5 * (begin + end), (end - begin) / SPREAD
            out.append(Constant(name, kinds.GRAVITY, size, centre=middle, width=width, stated=True))
    return tuple(out)


def _changes(fit: Fitted) -> Floats:
    """Of gravity over itself, at nodes, by horizontal and by vertical motion: (2, k)."""
    problem, at = fit.model.problem, 2 * fit.model.problem.pendulums
    changes = np.zeros((2, problem.lattice.nodes))
    for each in fit.model.assumed.ship:
        row, square = each.system()[1], (each.peak / problem.swing) ** 2
        motion = (fit.path[:, at : at + row.size] @ row) ** 2
        at += row.size
        if each.axis == "horizontal":
            response = (1.0 - square) / ((1.0 - square) ** 2 + NEAR**2)
            changes[0] += (response - 0.5 * response**2) * motion
        elif each.axis == "tilt":  # if it were what sways the pendulums so far
            changes[0] += (0.5 - square) * motion
        elif each.axis == "vertical":
            changes[1] -= (4.0 - square) / ((4.0 - square) ** 2 + NEAR**2) * motion
    return changes


def stiffened(fit: Fitted) -> Fitted | None:
    """The same, where what tilts the case sways the pendulums instead, and stiffens them by its square: what tells one
    from the other, whatever their spectra. None where it cannot be followed."""
    problem = fit.model.problem
    track = _changes(fit)[0][:, None] + (problem.track if problem.track.size else np.zeros(1))
    return attempted(replace(fit.model, problem=replace(problem, track=track)), fit.path, most=1)


def change_by_rounding(fit: Fitted, gravity: Floats) -> float:
    """Change of gravity over reference gravity that rounding of readings has made; `gravity` as above."""
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    own = np.flatnonzero(lattice.trace < problem.traces)
    trace = lattice.trace[own]
    exact = np.einsum("rp,rp->r", lattice.combination[trace], angles(fit, lattice.time[own], np.eye(problem.pendulums)))
    exact += total(fit.model.constants, kinds.ZERO, problem.traces + 2)[trace]
    step = problem.steps[trace]
    rounded, smooth = lattice.value.copy(), lattice.value.copy()
    rounded[own] = np.where(step > 0.0, np.rint(exact / np.maximum(step, 1e-300)) * step, exact)
    smooth[own] = exact
    return _change(fit, gravity, problem.reading(rounded)) - _change(fit, gravity, problem.reading(smooth))


def doubt_by_repeating(fit: Fitted, gravity: Floats) -> float:
    """1 sigma of gravity over itself by errors of a film's readings that repeat with the swing; `gravity` as above.
    Dense readings are rid of their harmonics (`film_errors`); those at marks alias them onto the swing: the second and
    the third may each be as large as the noise."""
    problem, lattice, model = fit.model.problem, fit.model.problem.lattice, fit.model
    square = 0.0
    for trace in range(problem.traces):
        own = fit.used(trace)
        if not own.size or lattice.spacing[trace] * problem.swing * ALIASED < np.pi:
            continue
        _, turn = swing_of(fit, trace, own)
        for wave in (turn**2, turn**3):
            for part in (wave.real, wave.imag):
                value = lattice.value.copy()
                value[own] += model.assumed.noise[trace] * part
                square += _change(fit, gravity, problem.reading(value)) ** 2
    return float(np.sqrt(square))


def _change(fit: Fitted, gravity: Floats, problem: Problem) -> float:
    """Of gravity, where the same model is fitted to another problem; `gravity` as above."""
    found = fitted(replace(fit.model, problem=problem), fit.path, most=1)
    pairs = zip(found.solution.constants, fit.solution.constants, strict=True)
    return float(gravity @ [one.value - other.value for one, other in pairs])


def doubt_by_delay(fit: Fitted, sigma: Any) -> float:
    """1 sigma of gravity over itself by one of how late all traces of a film are, s: where its paper changes its speed,
    that changes too, and nothing but the paper's marks tells time."""
    pace, lattice = fit.model.problem.pace, fit.model.problem.lattice
    if not pace.size:
        return 0.0
    return 2.0 * float(np.ravel(sigma)[0]) * abs(float(np.polyfit(lattice.time, pace, 1)[0]))


def doubt_by_scale(fit: Fitted, sigma: Any) -> float:
    """1 sigma of gravity over itself by one of the scale of all angles, where unknown vertical motion is assumed: it
    grows by a quarter of an amplitude's square."""
    problem = fit.model.problem
    if np.ndim(sigma) or not fit.model.assumed.heaves:
        return 0.0
    return 0.5 * float(sigma) * float(np.var(fit.path[:, : 2 * problem.pendulums : 2], axis=0).max())
