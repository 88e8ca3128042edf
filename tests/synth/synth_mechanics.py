"""Equations of motion of scenes by another way than the simulator's: Newton's law for every bob, solved as matrices.

With positions r(q), Jacobian J and masses m: J^T m J q'' = Q + J^T (F - m (J' q' + a)), where a is the acceleration of
the ship and Q holds springs, brakes and torques. Numbers come from the scene's own words.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from data_schemas.scene import Scene

Array = np.ndarray
Slope = Callable[[float, Array], Array]


def solved(scene: Scene, start: Array, times: Array) -> Array:
    """States (angle and rate of each pendulum, before them those of a beam or frame) at the times, by DOP853."""
    slope = {"fixed": _fixed, "beam": _beam, "frame": _frame, "board": _board}[scene.support.kind](scene)
    end = max(float(times[-1]), 1e-3)
    found = solve_ivp(slope, (0.0, end), start, "DOP853", times, rtol=1e-12, atol=1e-15)
    assert found.success
    return np.asarray(found.y.T)


def acceleration(scene: Scene, axis: str, time: float) -> float:
    total = 0.0
    for term in scene.motion:
        if term.kind == "harmonics" and term.axis == axis:
            rate = 2 * np.pi / np.array(term.period)
            phase = np.zeros(rate.size) if term.phase is None else np.array(term.phase)
            total += float(np.sum(np.array(term.amplitude) * np.cos(rate * time + phase)))
    return total


def gravity(scene: Scene, time: float) -> float:
    course: Any = scene.gravity_course
    if course is None:
        return scene.gravity
    if course.kind == "linear":
        return scene.gravity + course.rate * time
    return scene.gravity + course.amplitude * float(np.sin(2 * np.pi * time / course.period + course.phase))


def torques(scene: Scene, angle: Array, rate: Array) -> Array:
    """Angular acceleration by resistance and drive, one pendulum at a time."""
    result = np.zeros(angle.size)
    for i, each in enumerate(scene.pendulums):
        result[i] -= 2 * each.damping_rate * rate[i] + each.quadratic_damping * abs(rate[i]) * rate[i]
        if each.knife_edge is not None:
            result[i] -= each.knife_edge.friction * np.tanh(rate[i] / each.knife_edge.rate)
        drive = each.escapement
        if drive is not None and drive.kind == "van-der-pol":
            result[i] += drive.rate * (1 - (angle[i] / drive.angle) ** 2) * rate[i]
    return result


def lengths(scene: Scene) -> Array:
    return np.array([scene.reference_gravity * (each.period / (2 * np.pi)) ** 2 for each in scene.pendulums])


def _fixed(scene: Scene) -> Slope:
    length = lengths(scene)
    sine, cosine = (np.sin, np.cos) if scene.restoring == "sine" else (lambda x: x, np.ones_like)

    def slope(time: float, state: Array) -> Array:
        angle, rate = state[0::2], state[1::2]
        across, up = acceleration(scene, "horizontal", time), acceleration(scene, "vertical", time)
        pull = ((gravity(scene, time) + up) * sine(angle) + across * cosine(angle)) / length
        return np.stack([rate, torques(scene, angle, rate) - pull], axis=-1).ravel()

    return slope


def _yielding(scene: Scene, support: Array, spring: Callable[[float, float], float]) -> Slope:
    """A support with one freedom: `support` is the direction (across, up) in which it moves the pivots."""
    mass = np.array([each.mass for each in scene.pendulums])
    length = lengths(scene)
    own: Any = scene.support

    def slope(time: float, state: Array) -> Array:
        angle, rate = state[2::2], state[3::2]
        felt = -np.array(
            [acceleration(scene, "horizontal", time), scene.gravity + acceleration(scene, "vertical", time)]
        )
        n = angle.size
        matrix, force = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
        matrix[0, 0] = own.mass
        force[0] = spring(state[0], state[1]) + own.mass * support @ felt
        for i in range(n):
            jacobian = np.zeros((2, n + 1))
            jacobian[:, 0] = support
            jacobian[:, i + 1] = length[i] * np.array([np.cos(angle[i]), np.sin(angle[i])])
            turning = length[i] * rate[i] ** 2 * np.array([-np.sin(angle[i]), np.cos(angle[i])])
            matrix += mass[i] * jacobian.T @ jacobian
            force += mass[i] * jacobian.T @ (felt - turning)
        force[1:] += mass * length**2 * torques(scene, angle, rate)
        found = np.linalg.solve(matrix, force)
        return np.concatenate([[state[1], found[0]], np.stack([rate, found[1:]], axis=-1).ravel()])

    return slope


def _beam(scene: Scene) -> Slope:
    own: Any = scene.support
    whole = own.mass + sum(each.mass or 0.0 for each in scene.pendulums)

    def spring(x: float, speed: float) -> float:
        return -own.stiffness * x - whole * own.damping_rate * speed - whole * scene.gravity  # sagged by its weight

    return _yielding(scene, np.array([0.0, -1.0]), spring)


def _frame(scene: Scene) -> Slope:
    own: Any = scene.support
    return _yielding(scene, np.array([1.0, 0.0]), lambda x, speed: -own.stiffness * x - own.resistance * speed)


def _board(scene: Scene) -> Slope:
    own: Any = scene.support
    length = lengths(scene)

    def slope(time: float, state: Array) -> Array:
        angle, rate = state[0::2], state[1::2]
        cosine, sine = np.cos(angle), np.sin(angle)
        weight = scene.gravity + acceleration(scene, "vertical", time)
        free = torques(scene, angle, rate) - weight * sine / length - own.coupling * cosine * np.sum(sine * rate**2)
        found = np.linalg.solve(np.eye(angle.size) - own.coupling * np.outer(cosine, cosine), free)
        return np.stack([rate, found], axis=-1).ravel()

    return slope
