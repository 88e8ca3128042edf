"""Two linear pendulums on a support that moves in harmonics, in closed form: a reference that shares no code with ours.

`theta_i'' + 2 gamma_i theta_i' + n_i^2 theta_i = -n_i^2 u`, u = sum of alpha cos(m t + delta). The free harmonic is
`Re[A e^{lam t}]`, the forced one follows from the transfer function.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.observation import Observation

G = 9.81
N2 = 2.0 * np.pi / 1.01


@dataclass(frozen=True)
class Pair:
    """Both pendulums; `frequency` is infinitesimal and undamped, `free` are the complex free amplitudes at t = 0."""

    frequency: tuple[float, float]
    damping: tuple[float, float] = (0.0, 0.0)
    free: tuple[complex, complex] = (0.012 * np.exp(0.4j), 0.006 * np.exp(2.2j))
    forcing: tuple[tuple[float, float, float], ...] = field(default=())  # alpha, m, delta

    @staticmethod
    def apart(eps: float, n2: float = N2, **parts: object) -> Pair:
        return Pair((n2 * (1.0 + eps), n2), **parts)  # type: ignore[arg-type]  # parts are the fields above

    def elongation(self, which: int, time: np.ndarray, derivative: int = 0) -> np.ndarray:
        return self.harmonic(which, time, derivative).real + self.slow(which, time, derivative)

    def harmonic(self, which: int, time: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Analytic signal of the free harmonic."""
        n, gamma = self.frequency[which], self.damping[which]
        lam = -gamma + 1j * np.sqrt(n * n - gamma * gamma)
        return self.free[which] * lam**derivative * np.exp(lam * time)

    def slow(self, which: int, time: np.ndarray, derivative: int = 0) -> np.ndarray:
        n, gamma = self.frequency[which], self.damping[which]
        total = np.zeros_like(np.asarray(time, dtype=float))
        for alpha, m, delta in self.forcing:
            transfer = -(n * n) / (n * n - m * m + 2j * gamma * m)
            total += (transfer * alpha * (1j * m) ** derivative * np.exp(1j * (m * time + delta))).real
        return total

    def difference(self, time: np.ndarray) -> np.ndarray:
        return self.elongation(0, time) - self.elongation(1, time)

    def acceleration_ratio(self, time: np.ndarray) -> np.ndarray:
        """u = x''/g."""
        return sum(
            (alpha * np.cos(m * time + delta) for alpha, m, delta in self.forcing), np.zeros_like(np.asarray(time))
        )

    def observe(self, time: np.ndarray, *, step: float, **changes: object) -> Observation:
        """The pair as an `Observation` whose periods are right at g = 9.81."""
        seen = Observation(
            first="1",
            second="2",
            start=0.0,
            time=time,
            step=step,
            theta=self.elongation(0, time),
            difference=self.difference(time),
            sigma_theta=None,
            sigma_difference=None,
            frequency_reference=np.array(self.frequency),
            damping_rate=np.array(self.damping),
            reference_gravity=G,
            period_relative_uncertainty=np.zeros(2),
            chronometer_rate=0.0,
            restoring="linear",
        )
        return replace(seen, **changes)  # type: ignore[arg-type]  # changes are fields of Observation


def swell(count: int = 12, size: float = 0.06, seed: int = 5) -> tuple[tuple[float, float, float], ...]:
    """Harmonics of 4 to 20 s whose elongations add up to about `size` rad rms."""
    random = np.random.default_rng(seed)
    frequency = 2.0 * np.pi / random.uniform(4.0, 20.0, count)
    alpha = random.uniform(0.5, 1.0, count)
    alpha *= size / np.sqrt(0.5 * np.sum(alpha**2))
    return tuple(zip(alpha.tolist(), frequency.tolist(), random.uniform(0, 2 * np.pi, count).tolist(), strict=True))


def milligal(frequency: float, true: float, gravity: float = G) -> float:
    """Error of gravity that an error of the frequency makes, mGal."""
    return 2e5 * gravity * (frequency / true - 1.0)
