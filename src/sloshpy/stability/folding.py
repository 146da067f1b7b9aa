"""What a digital autopilot's sampler folds into the loop, measured in the disc margin of eq 24.

Margins take of the sampler its gain alone. A motion above half the sampling frequency, such as a bending mode, comes
back at a lower one; where that moves a margin, the margins do not support a verdict.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.dynamics.response import transfer
from sloshpy.dynamics.sampled import SampledLoop, sampled_loop
from sloshpy.stability.margins import DISTANT, Margins
from sloshpy.stability.nichols import nichols_disc_margin, sampled
from sloshpy.units import Array

TOLERATED = 0.02  # of disc margin: a fiftieth of what is asked for


@dataclass(frozen=True, kw_only=True)
class Folding:
    """The greatest difference of eq 24 with and without folding where either is near, and where, rad/s."""

    difference: float
    omega: float

    @property
    def tolerated(self) -> bool:
        """Whether the margins hold without what is folded."""
        return self.difference <= TOLERATED

    def __str__(self) -> str:
        at = f"at {self.omega / 2.0 / np.pi:.4g} Hz"
        if self.tolerated:
            most = max(self.difference, 1e-6)
            return f"what the sampler folds from above half its rate moves no disc margin by more than {most:.1g}"
        return (
            f"FOLDING: motion above half the sampling rate is folded into the loop and moves its disc margin by "
            f"{self.difference:.2g} {at}; filter it before it is sampled, or sample faster"
        )


def folding(found: Margins) -> Folding | None:
    """Return what the sampler of one loop folds into it; None where the autopilot is continuous."""
    loop = found.source
    if loop.autopilot.sample_time is None:
        return None
    exact = sampled_loop(loop)
    GM, PM = found.criteria.gain_margin, found.criteria.phase_margin
    omega = np.union1d(sampled(loop, GM, PM).omega, _about_poles(exact))
    curves = transfer(loop.along(), 1j * omega).loop, exact.loop(omega)
    without, whole = (nichols_disc_margin(L, GM, PM) for L in curves)
    near = np.minimum(without, whole) < 0.5 * DISTANT
    difference = np.where(near, np.abs(without - whole), 0.0)
    k = int(np.argmax(difference))
    return Folding(difference=float(difference[k]), omega=float(omega[k]))


def _about_poles(loop: SampledLoop) -> Array:
    """Return frequencies about the poles of the broken and of the closed loop, in steps of their half-width, rad/s."""
    z = np.concatenate([loop.poles, np.linalg.eigvals(loop.A)])
    s = np.log(z[np.abs(z) > 1e-6].astype(complex)) / loop.sample_time
    offsets = 0.7 * 3.0 ** np.arange(12)
    half = np.maximum(np.abs(s.real), 1e-9 * np.abs(s))
    omega = (s.imag[:, None] + half[:, None] * np.concatenate([-offsets, offsets])).ravel()
    return np.asarray(omega[(omega > 0.0) & (omega < np.pi / loop.sample_time)])
