"""The loop, broken at the engine command: plant, autopilot and one slosh damping for each tank.

            +--------------------------------------------------------------------+
            |                                                                    |
    L(s) = -|  a0 phi + a1 phi' + ... <-- plant <-- beta <-- actuator <-- delay <-- filters <-- gain
                                                          ^ broken here

L(s) has the negative-feedback sign: the critical point is -1, that is 0 dB at -180 deg.
"""

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sloshpy.autopilot import Autopilot
from sloshpy.autopilot.coefficients import axes, mapped
from sloshpy.case import Case, accelerometer_fault
from sloshpy.damping import small_amplitude_ratio
from sloshpy.dynamics.plant import Plant, plant, without_drift
from sloshpy.errors import OutsideValidity
from sloshpy.units import Array, IntArray, Real

# arrays of the plant and how many of their axes are not the batch's
_ARRAYS = {
    **dict.fromkeys(("mass", "damping", "stiffness", "accelerometer"), 2),
    **dict.fromkeys(("force", "inertial_force", "attitude", "rate", "tank_mass", "tank_frequency"), 1),
}


@dataclass(frozen=True, kw_only=True)
class Loop:
    """One loop, or a batch of loops whose leading axes broadcast.

    plant: without drift. autopilot: its numbers may carry the batch's axes. damping: (..., n_tanks), slosh damping
    ratios.
    """

    plant: Plant
    autopilot: Autopilot
    damping: Array

    @functools.cached_property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch, () for one loop."""
        return np.broadcast_shapes(self.plant.mass.shape[:-2], self.damping.shape[:-1], *axes(self.autopilot))

    def others(self, depth: int) -> list[tuple[int, ...]]:
        """Return the batch shapes of all but the slosh damping, those of fewer axes than `depth` as ()."""
        p = self.plant
        shapes = [x.shape[: x.ndim - own] for k, own in _ARRAYS.items() if (x := getattr(p, k)) is not None]
        shapes += axes(self.autopilot)
        return [shape if len(shape) == depth else () for shape in shapes]

    def along(self) -> "Loop":
        """Return the loop with a new last batch axis of length one, along which frequencies or poles run."""
        return self._mapped(lambda x, own: np.expand_dims(x, x.ndim - own))

    def take(self, index: IntArray) -> "Loop":
        """Return loops picked from the flattened batch; `index` holds integers of any shape."""
        chosen = np.asarray(index, dtype=int)
        place = np.unravel_index(chosen, self.batch) if self.batch else ()
        first = np.zeros_like(chosen)

        def pick(x: Array, own: int) -> Array:
            axes = x.shape[: x.ndim - own]
            if not axes:
                return x
            at = place[len(place) - len(axes) :]
            return np.asarray(x[tuple(k if size > 1 else first for k, size in zip(at, axes, strict=True))])

        return self._mapped(pick)

    def _mapped(self, change: Any) -> "Loop":
        """Apply a change of the batch axes to every array; `own` is the number of axes that are not the batch's.

        What has no batch axes is left as it is: one plant and autopilot at many dampings are copied by nobody.
        """
        p, a = self.plant, mapped(self.autopilot, lambda x: np.asarray(change(x, 0)))
        parts = {k: (x, own) for k, own in _ARRAYS.items() if (x := getattr(p, k)) is not None}
        if any(x.ndim > own for x, own in parts.values()):
            p = replace(p, **{k: change(x, own) for k, (x, own) in parts.items()})
        return Loop(plant=p, autopilot=a, damping=change(self.damping, 1))


def open_loop(case: Case, damping: Real | None = None, amplitude: Real | None = None) -> Loop:
    """Return the loop of a case at given slosh damping.

    Args:
        case: vehicle and autopilot; their fields may carry leading axes.
        damping: slosh damping ratios, one for all tanks or (..., n_tanks).
        amplitude: slosh amplitudes in m at which each tank's law is read (same shapes); default: small amplitude.

    Raises:
        OutsideValidity: an amplitude outside a tank's damping table, or an accelerometer fed back without its station,
            shapes or lag (a case that was changed by `model_copy`; a new one is refused at once).
    """
    if damping is not None and amplitude is not None:
        raise ValueError("give damping or amplitude: each says what the other would")
    fault = accelerometer_fault(case.vehicle, case.autopilot)
    if fault is not None:
        raise OutsideValidity(f"{' '.join(map(str, fault[0]))} {fault[1]}; {fault[2]}")
    if case.autopilot.mixed_drift:
        raise OutsideValidity(
            f"{case.autopilot.mixed_drift} is 0 for some of the batch; put those into one of their own"
        )
    n = len(case.vehicle.tanks)
    laws = [tank.damping for tank in case.vehicle.tanks]
    if damping is None and amplitude is None:
        xi = np.array([small_amplitude_ratio(law) for law in laws])
    elif damping is not None:
        xi = _per_tank(damping, n)
        if not np.all(np.isfinite(xi)) or np.any(xi < 0.0):
            raise ValueError("slosh damping ratios must be finite and >= 0")
    else:
        A = _per_tank(amplitude if amplitude is not None else 0.0, n)
        if not np.all(np.isfinite(A)) or np.any(A < 0.0):
            raise ValueError("slosh amplitudes must be finite and >= 0 m")
        xi = np.stack([law.ratio(A[..., j]) for j, law in enumerate(laws)], axis=-1) if n else A
        unknown = [t.name for j, t in enumerate(case.vehicle.tanks) if np.any(np.isnan(xi[..., j]))]
        if unknown:
            raise OutsideValidity(f"the amplitude is outside the damping data of {', '.join(unknown)}")
        beyond = [t.name for j, t in enumerate(case.vehicle.tanks) if np.any(xi[..., j] > 1.0)]
        if beyond:
            raise OutsideValidity(f"at that amplitude the law of {', '.join(beyond)} gives more than critical damping")
    a = case.autopilot
    kept = without_drift(plant(case.vehicle), bool(np.any(a.drift_gain)), bool(np.any(a.drift_rate_gain)))
    return Loop(plant=kept, autopilot=a, damping=xi)


def _per_tank(value: Real, n: int) -> Array:
    array = np.asarray(value, dtype=float)
    if array.ndim == 0:
        return np.full(n, array)
    if array.shape[-1] != n:
        raise ValueError(
            f"the last axis holds one value for each of the {n} tanks, this has shape {array.shape}; "
            + ("a damping axis is written damping[:, None]" if n == 1 else f"a damping axis has shape (.., {n})")
        )
    return array
