"""One period of a periodic motion from its odd harmonics: x(t) = Re sum_k x_k exp(j k W t)."""

from dataclasses import dataclass

import numpy as np

from sloshpy.limit_cycle.harmonic_balance import Balance, accelerations, motion, velocities
from sloshpy.units import Array, ComplexArray, IntArray

SAMPLES = 4096  # of one period, from which a peak is refined


@dataclass(frozen=True, kw_only=True)
class Waveform:
    """Harmonics of everything that moves.

    number: (K,), odd. slosh: (n_tanks, K), m. tvc, attitude: (K,), rad.
    """

    omega: float
    number: IntArray
    slosh: ComplexArray
    tvc: ComplexArray
    attitude: ComplexArray

    @property
    def amplitudes(self) -> Array:
        """Half peak-to-peak of every tank's slosh in m, then of the engine in rad, (n_tanks + 1,)."""
        return np.array([peak(x, self.number) for x in (*self.slosh, self.tvc)])


def waveform(b: Balance, V: ComplexArray, omega: float) -> Waveform:
    """Return the motion of which V (n_tanks, K) are the slosh velocities."""
    p, s = b.loop.plant, 1j * omega * b.number
    u = accelerations(b, velocities(b, V, b.samples))
    U = np.fft.rfft(u, axis=-1)[:, b.number] * (2.0 / b.samples)
    x = np.einsum("kij,jk->ik", motion(b.loop, s)[0], U + b.relief[:, None] * V)
    return Waveform(omega=omega, number=b.number, slosh=V / s, tvc=x[-1], attitude=p.attitude @ x[:-1])


def peak(x: ComplexArray, number: IntArray) -> float:
    """Return the greatest value over one period; half peak-to-peak, since odd harmonics mirror each half period."""
    wave = np.exp(2j * np.pi * np.outer(number, np.arange(SAMPLES // 2)) / SAMPLES)
    at = 2.0 * np.pi * int(np.argmax(np.abs((x @ wave).real))) / SAMPLES
    for _ in range(4):  # Newton's method on the slope
        turned = x * np.exp(1j * number * at)
        slope, curve = float(np.sum((1j * number * turned).real)), -float(np.sum((number**2 * turned).real))
        at -= float(np.clip(slope / curve, -np.pi / SAMPLES, np.pi / SAMPLES)) if curve else 0.0
    return abs(float(np.sum((x * np.exp(1j * number * at)).real)))


def share(x: ComplexArray) -> float:
    """Return the rms of everything but the fundamental as a part of the whole; 0 at rest."""
    power = np.abs(x) ** 2
    return float(np.sqrt(np.sum(power[1:]) / np.sum(power))) if np.any(power) else 0.0
