"""The shipped synthetic record: a sub-scale tank's free decay, integrated, not taken from the formula that fits it.

`python tests/synthetic_decay.py` writes src/sloshpy/data/records/subscale_decay.csv again.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from sloshpy.damping import DampingLaw, PowerDamping

RECORD = Path(__file__).parents[1] / "src" / "sloshpy" / "data" / "records" / "subscale_decay.csv"
RADIUS = 0.5  # m
FREQUENCY = 6.01  # rad/s: sqrt(1.841 g/R), deep, at 1 g
WAVE_PER_DISPLACEMENT = 1.54
LAW = PowerDamping(slope=0.5, exponent=1.0)  # alpha R = 0.25, as 0.1 1/m at 2.5 m

HEAD = """\
# SYNTHETIC: computed, not measured. A free decay of the first slosh mode in a sub-scale tank with ring baffles: radius
# 0.5 m, deep, at 1 g, released with 0.11 m of slosh-mass displacement. Truth: 6.01 rad/s, xi = 0.5 1/m * A; wave height
# at the wall 1.54 times the slosh-mass displacement; offset 12 mm, drift 0.1 mm/s, noise 0.8 mm rms, read to 0.1 mm.
# Made by tests/synthetic_decay.py. Every number is invented; the full tank meant is one of 2.5 m.
#
#   sloshpy decay subscale_decay.csv --column wave --amplitude wave --wave-per-displacement 1.54 \\
#       --frequency-hint 0.96Hz --radius 0.5m --full-radius 2.5m
"""


def decay(law: DampingLaw, frequency: float, start: float, time: np.ndarray) -> np.ndarray:
    """Return the slosh-mass displacement in m of x'' = acceleration(x') - w^2 x, released from rest."""

    def motion(_t: float, y: np.ndarray) -> list[float]:
        return [y[1], float(law.acceleration(y[1], frequency)) - frequency**2 * y[0]]

    return solve_ivp(motion, (0.0, time[-1]), [start, 0.0], "DOP853", time, rtol=1e-9, atol=1e-12).y[0]


def table() -> np.ndarray:
    """Return time in s and wave height in mm, (n, 2)."""
    time = np.arange(0.0, 30.0, 0.04)
    wave = 1e3 * WAVE_PER_DISPLACEMENT * decay(LAW, FREQUENCY, 0.11, time)
    noise = 0.8 * np.random.default_rng(20260101).standard_normal(len(time))
    return np.column_stack([time, np.round(wave + 12.0 + 0.1 * time + noise, 1)])


def text() -> str:
    """Return the whole file."""
    return HEAD + "time [s], wave [mm]\n" + "".join(f"{t:.2f}, {x:.1f}\n" for t, x in table())


if __name__ == "__main__":
    RECORD.write_text(text(), encoding="utf-8")
