"""A film in which everything has been drawn: pendulums and paper in motion, light, emulsion, dirt, scanner.

Light is summed spot by spot over steps of .4 of the spot's sigma. Density is
`fog + (top - fog) E^gamma / (E^gamma + E_0^gamma)`, unlike the curves of `plain` and of the product's own films.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import gaussian_filter, gaussian_filter1d

Draws = dict[str, Any]
"""What a film is made with, by name: lengths on the film in mm, times in s, densities and exposures."""
Floats = NDArray[np.float64]
Grey = NDArray[np.float32]
Random = np.random.Generator

INCH = 25.4
REFERENCE = 9.81
"""m/s^2, at which the periods are stated."""
AHEAD = 4.0
"""s of the simulation before the lamps are lit, and after."""
INTERVAL = 0.5
"""s, between marks."""
_STEP = 0.002  # s, of the integration: 2e-10 of the period
_DRIVE_STEP = 0.01  # s


def factors(name: str) -> list[tuple[int, float]]:
    """Indices and factors of the pendulums of a trace called "1" or "1-2"."""
    return [(int(label) - 1, sign) for label, sign in zip(name.split("-"), (1.0, -1.0), strict=False)]


class Drive(NamedTuple):
    """Where the slit stands on the paper at each time."""

    times: Floats
    along: Floats
    """mm from the paper's begin."""
    sideways: Floats


class Paper(NamedTuple):
    """The paper on the scanner; mm, but for the size of the scan in px."""

    pitch: float
    """Of the pixels."""
    width: float
    length: float
    rows: int
    columns: int
    tilt: float
    """rad."""
    splice: tuple[float, float, float] | None
    """Where, how much is lost there, and by how much the rest lies to the right."""

    def place(self, x: Floats, along: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Rows and columns of points of the film, from the centre of the first pixel, and which are not cut out."""
        shown = np.ones(along.shape, bool)
        if self.splice:
            cut, lost, shift = self.splice
            x, shown = np.where(along > cut, x + shift, x), ~((along > cut) & (along < cut + lost))
            along = np.where(along > cut, along - lost, along)
        sine, cosine = math.sin(self.tilt), math.cos(self.tilt)
        right, down = x - 0.5 * self.width, along - 0.5 * self.length
        columns = 0.5 * self.columns + (right * cosine - down * sine) / self.pitch - 0.5
        return 0.5 * self.rows + (right * sine + down * cosine) / self.pitch - 0.5, columns, shown


class Scene(NamedTuple):
    """All of a film but its pixels."""

    film: Draws
    angles: list[CubicHermiteSpline]
    """rad, of each pendulum."""
    amplitudes: list[float]
    """Largest deflection of each trace, mm."""
    positions: list[float]
    """mm across of each trace at rest."""
    drive: Drive
    paper: Paper
    marks: list[tuple[float, float]]
    """Times and lengths, s."""

    def path(self, trace: int, times: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """As `Paper.place`, of a trace at given times."""
        along = np.interp(times, self.drive.times, self.drive.along) + self.film["offsets"][trace]
        angle = angle_of(self.angles, self.film["layout"][trace], times)
        sideways = np.interp(times, self.drive.times, self.drive.sideways)
        return self.paper.place(self.positions[trace] + self.film["lever"] * angle + sideways, along)


def angle_of(angles: list[CubicHermiteSpline], name: str, times: Floats) -> Floats:
    """Elongation that a trace shows, rad."""
    angle: Floats = np.sum([sign * angles[k](times) for k, sign in factors(name)], axis=0)
    return angle


def lay_out(film: Draws, random: Random) -> Scene:
    """Swing the pendulums, run the paper, set the marks."""
    angles = _swing(film)
    times = np.arange(0.0, angles[0].x[-1], 0.05)
    amplitudes = [float(np.abs(angle_of(angles, name, times)).max() * film["lever"]) for name in film["layout"]]
    between = 2.0 if film["strobe"] else random.uniform(-0.4, 0.3) * float(np.mean(amplitudes))
    positions: list[float] = []
    edge = random.uniform(7, 10)
    for amplitude in amplitudes:
        positions.append(edge + amplitude)
        edge += 2 * amplitude + between
    width = positions[-1] + amplitudes[-1] + random.uniform(5, 9)
    if film["off_edge"] is not None:
        width = positions[-1] + amplitudes[-1] * film["off_edge"]
    drive, margin, used = _run(film, random)
    splice, length = None, 2 * margin + used
    if film["splice"]:
        where, lost, shift = film["splice"]
        splice, length = (margin + where * used, lost, shift), length - lost
    pitch, tilt, bed = INCH / film["dpi"], math.radians(film["tilt"]), 2 * film["border"]
    spread = abs(math.sin(tilt)) * length if bed else 0.0
    rows, columns = int((length + bed) / pitch), int((width + bed + spread) / pitch)
    paper = Paper(pitch, width, length, rows, columns, tilt, splice)
    return Scene(film, angles, amplitudes, positions, drive, paper, _marks(film, random))


def _swing(film: Draws) -> list[CubicHermiteSpline]:
    """theta'' + 2 gamma theta' = -n^2 [(1 + z''/g) sin theta + x''/g cos theta], from the forced motion on."""
    count, gravity = 3 if "2-3" in film["layout"] else 2, film["gravity"]
    frequencies, phases, pushes = np.array(film["waves"]).T
    rates = 2 * math.pi * frequencies
    steps = int((film["duration"] + 2 * AHEAD) / _STEP)
    arguments = rates * (np.arange(2 * steps + 1) * (0.5 * _STEP))[:, None] + phases
    sway = np.cos(arguments) @ (pushes / gravity)
    heave = -np.sin(arguments) @ (0.5 * pushes / gravity) if film["heaves"] else np.zeros_like(sway)
    times, angles = np.arange(steps + 1) * _STEP, []
    for period, amplitude, phase in zip(film["periods"][:count], film["amplitudes"], film["phases"], strict=False):
        square = (2 * math.pi / period) ** 2 * gravity / REFERENCE
        forced, free = -(square / gravity) * pushes / (square - rates**2), amplitude / film["lever"]
        angle = free * math.cos(phase) + float(forced @ np.cos(phases))
        rate = -free * math.sqrt(square) * math.sin(phase) - float((forced * rates) @ np.sin(phases))
        values, rates_of = _integrate(square, film["damping"], sway, heave, angle, rate, _STEP)
        angles.append(CubicHermiteSpline(times, values, rates_of))
    return angles


@njit()
def _integrate(
    square: float, damping: float, sway: Floats, heave: Floats, angle: float, rate: float, step: float
) -> tuple[Floats, Floats]:
    """Angles and rates by the classical Runge-Kutta method; accelerations over g at every half step."""
    count = (sway.size - 1) // 2
    angles, rates = np.empty(count + 1), np.empty(count + 1)
    for k in range(count + 1):
        angles[k], rates[k] = angle, rate
        if k == count:
            break
        moved, turned, x, v = 0.0, 0.0, angle, rate
        for stage in range(4):
            half = 2 * k + (stage + 1) // 2
            pull = -2 * damping * v - square * ((1 + heave[half]) * np.sin(x) + sway[half] * np.cos(x))
            weight = (1.0 if stage in (0, 3) else 2.0) * step / 6
            moved, turned = moved + weight * v, turned + weight * pull
            ahead = step if stage == 2 else 0.5 * step
            x, v = angle + ahead * v, rate + ahead * pull
        angle, rate = angle + moved, rate + turned
    return angles, rates


def _run(film: Draws, random: Random) -> tuple[Drive, float, float]:
    """The drive, the blank paper at both ends, and the length of the paper that was lit."""
    duration = film["duration"]
    times = np.arange(0, duration + 2 * AHEAD, _DRIVE_STEP)

    def noise(smooth: float, size: float) -> Floats:
        values = gaussian_filter1d(random.standard_normal(len(times)), smooth / _DRIVE_STEP / 2)
        return np.asarray(values * (size / (values.std() + 1e-12)))

    walk = noise(5, film["walk"])
    wow = film["wow"] * np.sin(2 * math.pi * times / film["wow_period"] + 1)
    speed = film["speed"] * (1 + film["drift"] * (times / duration - 0.5) + wow + walk)
    for place, length in film["stands"]:
        begin, ramp = AHEAD + place * duration, 0.03 / 4
        stopping = 1 / (1 + np.exp(np.clip((times - begin) / ramp, -50, 50)))
        starting = 1 / (1 + np.exp(np.clip((begin + length - times) / ramp, -50, 50)))
        speed *= np.clip(stopping + starting, 0, 1)
    along = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * _DRIVE_STEP)])
    sideways = noise(12, film["wander"])
    begin, end = np.interp([AHEAD, AHEAD + duration], times, along)
    margin = random.uniform(3, 12)
    return Drive(times, along - begin + margin, sideways), margin, float(end - begin)


def _marks(film: Draws, random: Random) -> list[tuple[float, float]]:
    """Times and lengths of the shutter's closings; the chronometer is ahead of the simulation's time."""
    offset, duration, gap, code = film["chronometer_offset"], film["duration"], film["gap"], film["code"]
    out = []
    first, last = math.ceil((AHEAD + offset) / INTERVAL), int((AHEAD + duration + offset) / INTERVAL)
    for k in range(first, last + 1):
        time, minute = k * INTERVAL - offset, k % round(60 / INTERVAL) == 0
        if (minute and code == "omitted") or random.random() < film["missing"]:
            continue
        out.append((time, gap * 2.5 if minute and code == "long" else gap))
        if minute and code == "double":
            out.append((time + 0.125, gap))
    out += [(random.uniform(AHEAD, AHEAD + duration), gap) for _ in range(film["false"])]
    return sorted(out)


@njit()
def _splat(image: Grey, rows: Floats, columns: Floats, weights: Floats, sigma: float, reach: float) -> None:
    """Add Gaussian spots of given weights on their axes, up to `reach` sigma."""
    height, width = image.shape
    side = int(reach * sigma) + 1
    bell = np.empty(2 * side + 2)
    for k in range(len(rows)):
        top, left = int(np.floor(rows[k])) - side, int(np.floor(columns[k])) - side
        if weights[k] <= 0 or top + 2 * side + 1 < 0 or top >= height or left + 2 * side + 1 < 0 or left >= width:
            continue
        for j in range(bell.size):
            bell[j] = np.exp(-((left + j - columns[k]) ** 2) / (2 * sigma * sigma))
        for row in range(max(top, 0), min(top + bell.size, height)):
            weight = weights[k] * np.exp(-((row - rows[k]) ** 2) / (2 * sigma * sigma))
            for column in range(max(left, 0), min(left + bell.size, width)):
                image[row, column] += weight * bell[column - left]


@njit()
def _stroke(cover: Grey, rows: Floats, columns: Floats, sigma: float, depth: float) -> None:
    """Cover the picture along a path."""
    height, width = cover.shape
    side = int(3 * sigma) + 1
    for k in range(len(rows)):
        middle, centre = int(rows[k]), int(columns[k])
        for row in range(max(0, middle - side), min(height, middle + side + 1)):
            for column in range(max(0, centre - side), min(width, centre + side + 1)):
                square = (row - rows[k]) ** 2 + (column - columns[k]) ** 2
                cover[row, column] = max(cover[row, column], depth * np.exp(-square / (2 * sigma * sigma)))


def _spot(film: Draws, sigma: float) -> list[tuple[float, float, float, float]]:
    """Gaussians of which a lamp's spot is made: place down and right, sigma, share."""
    if film["profile"] == "gauss":
        return [(0.0, 0.0, sigma, 1.0)]
    if film["profile"] == "skirt":
        return [(0.0, 0.0, sigma, 0.92), (0.0, 0.0, 2.2 * sigma, 0.08 / 2.2)]
    ring = [(0.98 * sigma * math.sin(turn), 0.98 * sigma * math.cos(turn)) for turn in np.arange(6) * math.pi / 3]
    return [(0.0, 0.0, 0.72 * sigma, 0.30), *((down, right, 0.72 * sigma, 0.23) for down, right in ring)]


def expose(scene: Scene) -> tuple[Grey, Grey | None]:
    """Light of the lamps and of marks across the film; apart from it, marks that take light away."""
    film, paper = scene.film, scene.paper
    image = np.zeros((paper.rows, paper.columns), np.float32)
    step = 0.4 * film["spot"] / (max(scene.amplitudes) * 6.4 + film["speed"])
    times = np.arange(AHEAD, AHEAD + film["duration"], step)
    lit = np.full(times.size, not film["strobe"])
    for time, length in scene.marks if film["mark_kind"] == "gaps" else ():
        length = film["gap"] if film["strobe"] else length
        first, last = np.searchsorted(times, [time - length / 2, time + length / 2])
        lit[first:last] = film["strobe"]
    sigma = math.sqrt(film["spot"] ** 2 + paper.pitch**2 / 12) / paper.pitch
    dwell = film["spot"] * math.sqrt(2 * math.pi) / film["speed"]
    for trace, lamp in enumerate(film["lamps"]):
        rows, columns, shown = scene.path(trace, times)
        for down, right, spread, share in _spot(film, sigma):
            weights = np.where(lit & shown, lamp * share * step / dwell, 0.0)
            _splat(image, rows + down, columns + right, weights, spread, 3.6)
    darkened = np.zeros_like(image) if film["mark_kind"] == "antilines" else None
    if film["mark_kind"] != "gaps":
        _lines(scene, image if darkened is None else darkened)
    if film["halation"] > 0:
        near = gaussian_filter(image, 0.35 / paper.pitch, truncate=3) * 0.6
        halo = near + gaussian_filter(image, 0.9 / paper.pitch, truncate=2.5) * 0.4
        image += np.float32(film["halation"]) * halo * np.float32(6)
    return image, darkened


def _lines(scene: Scene, image: Grey) -> None:
    """Marks as lines across the film, or as ticks at its edge: flashes of finite length."""
    film, paper, drive = scene.film, scene.paper, scene.drive
    sigma = math.sqrt(0.07**2 + paper.pitch**2 / 12) / paper.pitch
    begin, end = (1.2, 4.5) if film["mark_kind"] == "edge" else (0.0, paper.width)
    across = np.arange(begin, end, paper.pitch * 0.5)
    for time, length in scene.marks:
        flashes, spread = (2, 0.3) if length <= film["gap"] else (6, 1.0)
        weight = 1.3 * 0.5 / (sigma * math.sqrt(2 * math.pi)) / flashes * min(flashes, 3)
        for share in np.linspace(-0.5, 0.5, flashes):
            along = np.interp(time + share * length * spread, drive.times, drive.along)
            rows, columns, shown = paper.place(across, np.full(across.size, along))
            _splat(image, rows, columns, np.where(shown, weight, 0.0), sigma, 3.5)


def develop(scene: Scene, image: Grey, darkened: Grey | None, random: Random) -> Grey:
    """Transmission of the film, as it came out of the bath and the years."""
    film, paper = scene.film, scene.paper
    down, right = ((np.arange(size) + 0.5) * paper.pitch for size in image.shape)
    half, fog = film["middle_exposure"], film["fog"]
    if film["leak"]:
        end, strength, depth = film["leak"]
        leak = strength * np.exp(-(down if end == "start" else down[::-1]) / depth)
        ripple = (1 + 0.3 * np.sin(right / 11 + 1)).astype(np.float32)
        image += leak[:, None].astype(np.float32) * ripple * half
    image = image ** np.float32(film["gamma"])
    image = fog + (film["top_density"] - fog) * image / (image + np.float32(half ** film["gamma"]))
    if darkened is not None:
        image -= (image - np.float32(fog * 0.3)) * np.clip(darkened, 0, 1) * np.float32(0.95)
    if film["fade"]:
        begin, length, left = film["fade"]
        place = down / paper.length - begin
        share = 1 - (1 - left) * 0.5 * (np.tanh(place / 0.01) - np.tanh((place - length) / 0.01))
        image = (fog + (image - fog) * share[:, None]).astype(np.float32)
    for row, column, radius, depth in film["stains"]:
        square = (down - row * paper.length)[:, None] ** 2 + (right - column * paper.width) ** 2
        image += (depth / (1 + np.exp((np.sqrt(square) - radius) / 1.2))).astype(np.float32)
    _fold(film, paper, image)
    noise = random.standard_normal(image.shape, dtype=np.float32)
    if film["clump"] > 0:
        clumps = gaussian_filter(random.standard_normal(image.shape, dtype=np.float32), film["clump"])
        noise = 0.7 * noise + 0.7 * (clumps / clumps.std()) * (0.5 if film["grain"] > 0.1 else 1.0)
    image += np.float32(film["grain"] * film["dpi"] / 300) * np.sqrt(np.maximum(image, 0.02)) * noise
    if film["polarity"] == "positive":
        image = film["top_density"] + 0.05 - image
    return np.power(np.float32(10), -np.clip(image, 0, 4))


def _fold(film: Draws, paper: Paper, image: Grey) -> None:
    """Creases, which push the picture sideways and break the emulsion, and the joint of a splice."""
    columns = np.arange(paper.columns)
    for place, push, width in film["creases"]:
        row, side = int(place * paper.length / paper.pitch), int(6 * width / paper.pitch)
        for k in range(max(0, row - side), min(paper.rows, row + side)):
            away = (k + 0.5) * paper.pitch - place * paper.length
            shift = push * math.exp(-(away**2) / 2 / width**2) / paper.pitch
            image[k] = np.interp(columns - shift, columns, image[k])
            image[k] += np.float32(0.5 * math.exp(-((away / 0.1) ** 2) / 2))
    if paper.splice:
        row, side = int(paper.splice[0] / paper.pitch), int(5 / paper.pitch)
        image[max(0, row - side) : row + side] += 0.12
        image[max(0, row - 1) : row + 2] += 0.8


def _dirt(film: Draws, paper: Paper, random: Random) -> tuple[Grey, Grey]:
    """How much of each pixel is covered by dark dirt, and by bright."""
    shape, pitch, uniform = (paper.rows, paper.columns), paper.pitch, random.uniform
    dark, bright = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for _ in range(random.poisson(film["dust"] * paper.width * paper.length / 1e4)):
        row, column, sigma = uniform(0, shape[0]), uniform(0, shape[1]), uniform(0.03, 0.25) / pitch
        cover = dark if random.random() < 0.6 else bright
        _stroke(cover, np.array([row]), np.array([column]), sigma, uniform(0.4, 1))
    for _ in range(random.poisson(film["scratches"] * paper.length / 1000)):
        count = int(uniform(10, 120) / pitch * 2)
        rows = np.arange(count, dtype=float) * 0.5 + uniform(0, shape[0])
        columns = uniform(0, shape[1]) + np.cumsum(random.standard_normal(count)) * 0.05
        cover = bright if random.random() < 0.7 else dark
        _stroke(cover, rows, columns, max(0.5, uniform(0.02, 0.06) / pitch), uniform(0.3, 0.9))
    for _ in range(film["hairs"]):
        count = int(uniform(5, 25) / pitch * 2)
        begin, bend = uniform(0, 6.28), random.normal() * 0.002
        turn = begin + np.cumsum(bend + random.standard_normal(count) * 0.01)
        rows = uniform(0, shape[0]) + np.cumsum(np.sin(turn)) * 0.5
        columns = uniform(0, shape[1]) + np.cumsum(np.cos(turn)) * 0.5
        _stroke(dark, rows, columns, max(0.5, 0.035 / pitch), uniform(0.5, 0.9))
    return dark, bright


def scan(scene: Scene, clear: Grey, random: Random) -> Grey:
    """Grey levels 0 to 1 that the scanner reads of a film, dirt on it and all."""
    film, paper = scene.film, scene.paper
    dark, bright = _dirt(film, paper, random)
    clear = clear * (1 - dark * 0.9)
    clear += (np.float32(0.92) - clear) * bright
    down = (np.arange(paper.rows) + 0.5) * paper.pitch
    clear *= (1 - film["vignette"] * np.linspace(-1, 1, paper.columns) ** 2).astype(np.float32)
    clear *= (1 + film["uneven"] * np.sin(down / paper.length * 5 + 1))[:, None].astype(np.float32)
    if film["border"]:
        right = (np.arange(paper.columns) + 0.5 - paper.columns / 2) * paper.pitch
        below = ((np.arange(paper.rows) + 0.5 - paper.rows / 2) * paper.pitch)[:, None]
        sine, cosine = math.sin(paper.tilt), math.cos(paper.tilt)
        outside = np.abs(right * cosine + below * sine) > 0.5 * paper.width
        outside |= np.abs(below * cosine - right * sine) > 0.5 * paper.length
        clear[outside] = film["bed"]
    clear = gaussian_filter(clear, film["blur"], truncate=3)
    clear += random.standard_normal(clear.shape, dtype=np.float32) * np.float32(0.003)
    clear = np.clip(clear / 1.05, 0, 1)
    if film["srgb"]:
        clear = clear ** np.float32(1 / 2.2)
    return np.rot90(clear) if film["landscape"] else clear
