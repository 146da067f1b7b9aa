"""Steady answer of an actuator with limits to a sinusoidal command, marched until it repeats; compiled."""

from typing import Any

import numba
import numpy as np

from sloshpy.autopilot.motion import actuator_motion

_motion: Any = numba.njit(actuator_motion)


@numba.njit
def steady_answer(
    command: float,
    omega: float,
    frequency: float,
    damping: float,
    stop: float,
    fastest: float,
    deadband: float,
    start: complex,
    steps: int,
    periods: int,
    settled: float,
) -> tuple[complex, float]:
    """Return the fundamental of the engine angle, relative to the command's phase, and its greatest magnitude, rad.

    Args:
        command, omega: amplitude in rad and rad/s of the command B sin(W t).
        frequency, damping, stop, fastest, deadband: see `actuator_motion`.
        start: fundamental to start from, rad.
        steps: of one period, even. periods: at most. settled: change of the fundamental over B that counts as none.
    """
    h = 2.0 * np.pi / omega / steps
    x, v = start.imag, omega * start.real
    now, peak = complex(0.0, 0.0), 0.0
    for _ in range(periods):
        before, peak, c, s = now, 0.0, 0.0, 0.0
        xh, vh = 0.0, 0.0
        for k in range(steps):
            if 2 * k == steps:
                xh, vh = x, v
            t = k * h
            here, half = command * np.sin(omega * t), command * np.sin(omega * (t + 0.5 * h))
            a1, b1 = _motion(x, v, here, frequency, damping, stop, fastest, deadband)
            a2, b2 = _motion(x + 0.5 * h * a1, v + 0.5 * h * b1, half, frequency, damping, stop, fastest, deadband)
            a3, b3 = _motion(x + 0.5 * h * a2, v + 0.5 * h * b2, half, frequency, damping, stop, fastest, deadband)
            there = command * np.sin(omega * (t + h))
            a4, b4 = _motion(x + h * a3, v + h * b3, there, frequency, damping, stop, fastest, deadband)
            c += x * np.cos(omega * t)
            s += x * np.sin(omega * t)
            peak = max(peak, abs(x))
            x += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
            v += h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4)
        # a rate-limited engine keeps an offset for long; the cycle has none, x(t + T/2) = -x(t)
        x, v = 0.5 * (x - xh), 0.5 * (v - vh)
        now = complex(s, c) * 2.0 / steps
        if abs(now - before) <= settled * command:
            break
    return now, peak
