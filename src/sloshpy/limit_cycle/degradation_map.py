"""The limit cycle over degradations of gain and delay; the paper's point of least disc margin is one of them.

Each cell is the loop with that much more gain and delay. A cycle found in one cell (growth curve) is followed from cell
to cell with frequency and amplitudes solved together; where it cannot be followed the growth curve decides anew.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.limit_cycle.degraded_cycles import UNSUPPORTED, DegradedCycles
from sloshpy.limit_cycle.five_steps import predict_limit_cycle
from sloshpy.limit_cycle.limit_cycle import LimitCycle
from sloshpy.units import Array, BoolArray, IntArray

if TYPE_CHECKING:
    import xarray as xr

# what stands in a cell, in the order of the codes
REASONS = (
    "a stable limit cycle",
    "stable at small amplitude: comes to rest",
    "no cycle inside the damping data and the limits of the engine",
    "several modes grow at once: simulate it",
    "diverges: no amplitude gives enough damping",
)


@dataclass(frozen=True, kw_only=True)
class DegradationMap:
    """The greatest stable limit cycle of the loop degraded by gain and delay.

    gain_db: (G,). delay: (D,), s, on top of the autopilot's own. reason: (G, D), index into `REASONS`.
    tvc: (G, D), rad. slosh: (G, D), m, of the tank. omega: (G, D), rad/s, nan without a cycle. 0 at rest, inf where it
    diverges, nan where no number is supported.
    predicted: the paper's five steps for the tank; `point` is its degradation, dB and s, nan where it has none.
    point_tvc: greatest stable cycle at that point, all tanks coupled, rad; nan where none is predicted.
    ellipse: (2, E), dB and s, the disc margin of the criteria, its phase as a delay at `ellipse_omega` rad/s; the part
    that is a delay within the map. ellipse_tvc: (E,), rad, the cycle at its points.
    """

    case: Case
    tank: str
    gain_db: Array
    delay: Array
    tvc: Array
    slosh: Array
    omega: Array
    reason: IntArray
    predicted: LimitCycle
    point_tvc: float
    ellipse: Array
    ellipse_tvc: Array
    ellipse_omega: float

    @property
    def limit(self) -> float:
        """The engine amplitude that the criteria accept, rad."""
        return self.case.criteria.tvc_amplitude

    @property
    def point(self) -> tuple[float, float]:
        """The paper's point, dB and s."""
        return self.predicted.gain_db, self.predicted.delay

    @property
    def inside(self) -> BoolArray:
        """Cells within the ellipse, (G, D)."""
        criteria = self.case.criteria
        gain = self.gain_db[:, None] / (20.0 * np.log10(criteria.gain_margin))
        phase = self.delay * self.ellipse_omega / criteria.phase_margin
        return np.asarray(np.hypot(gain, phase) <= criteria.disc_margin)

    @property
    def worst_inside(self) -> float:
        """Greatest engine amplitude in the cells within the ellipse and on it, rad; nan where one has no number."""
        return float(np.max(np.append(self.tvc[self.inside], self.ellipse_tvc), initial=0.0))

    @property
    def worst(self) -> float:
        """The same with the five steps, which take the greatest over the whole band about the cycle, rad."""
        band = self.predicted.worst_tvc_amplitude
        return max(self.worst_inside, band) if np.isfinite(band) else self.worst_inside

    def __str__(self) -> str:
        cells = [f"{np.sum(self.reason == k)} {words}" for k, words in enumerate(REASONS) if np.any(self.reason == k)]
        worst = self.worst_inside
        unknown = int(np.sum(np.isnan(np.append(self.tvc[self.inside], self.ellipse_tvc))))
        told = _angle(worst) if np.isfinite(worst) else "it diverges"
        if unknown:
            told = f"no number at {unknown} points in it or on its edge"
        lines = [
            f"Degradation map of {self.tank}: {self.tvc.size} cells, {self.gain_db[0]:g} to {self.gain_db[-1]:g} dB, "
            f"{1e3 * self.delay[0]:.4g} to {1e3 * self.delay[-1]:.4g} ms",
            f"  greatest engine amplitude inside the disc margin: {told}, limit {_angle(self.limit)}",
        ]
        if self.worst > worst:
            lines.append(f"  the five steps, which decide, take {_angle(self.worst)} over the band")
        if np.isfinite(self.point[0]):
            number = _angle(self.point_tvc) if np.isfinite(self.point_tvc) else "not supported"
            lines.append(f"  the paper's point: {self.point[0]:.3f} dB, {1e3 * self.point[1]:.1f} ms, {number}")
        return "\n".join([*lines, *(f"  cells: {words}" for words in cells)])

    def to_dataset(self) -> "xr.Dataset":
        """Return the map as an xarray Dataset over gain and delay."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        axes = ["gain_db", "delay"]
        return xr.Dataset(
            {
                "tvc": (axes, self.tvc, {"units": "rad"}),
                "slosh": (axes, self.slosh, {"units": "m"}),
                "omega": (axes, self.omega, {"units": "rad/s"}),
                "reason": (axes, self.reason, {"flag_meanings": "; ".join(REASONS)}),
            },
            coords={
                "gain_db": ("gain_db", self.gain_db, {"units": "dB"}),
                "delay": ("delay", self.delay, {"units": "s"}),
            },
            attrs={"tank": self.tank, "point_gain_db": self.point[0], "point_delay_s": self.point[1]},
        )


def degradation_map(
    case: Case, tank: int | str = 0, gain_db: Array | None = None, delay: Array | None = None
) -> DegradationMap:
    """Return the limit cycle of a case over degradations of its loop by gain and delay.

    Args:
        case: one vehicle and autopilot.
        tank: name or number of the tank whose slosh amplitude and paper's point are meant.
        gain_db: (G,), increasing, dB; default: 21 values to 1.25 of the gain margin either way.
        delay: (D,), increasing, s; default: 21 values to 1.25 of the phase margin, as a delay at the frequency of the
            tank's least disc margin.
    """
    single(case, "degradation_map")
    tank, criteria = case.tank_index(tank), case.criteria
    predicted = predict_limit_cycle(case, tank)
    mass = case.vehicle.tanks[tank]
    W = predicted.omega if np.isfinite(predicted.omega) else float(mass.frequency)
    reach_db = criteria.disc_margin * 20.0 * np.log10(criteria.gain_margin)
    reach = criteria.disc_margin * criteria.phase_margin / W
    gain_db = np.linspace(-1.25, 1.25, 21) * reach_db if gain_db is None else np.asarray(gain_db, dtype=float)
    delay = np.linspace(0.0, 1.25, 21) * reach if delay is None else np.asarray(delay, dtype=float)
    turn = np.linspace(0.0, 2.0 * np.pi, 721)
    ellipse = np.stack([reach_db * np.cos(turn), reach * np.sin(turn)])
    seen = (ellipse[0] >= gain_db[0]) & (ellipse[0] <= gain_db[-1])
    seen &= (ellipse[1] >= delay[0]) & (ellipse[1] <= delay[-1])
    ellipse = ellipse[:, seen]
    field = DegradedCycles(case, tank, 10.0 ** (gain_db / 20.0), delay)
    field.fill()
    actuator = case.autopilot.actuator
    if actuator is not None:  # the map's balance is that of the linear engine
        beyond = np.isfinite(field.tvc) & (field.tvc > 0.0) & actuator.beyond(field.tvc, field.omega)
        field.tvc[beyond], field.slosh[beyond], field.reason[beyond] = np.nan, np.nan, UNSUPPORTED
    shape = (len(gain_db), len(delay))
    return DegradationMap(
        case=case,
        tank=mass.name,
        gain_db=gain_db,
        delay=delay,
        tvc=field.tvc.reshape(shape),
        slosh=field.slosh.reshape(shape),
        omega=field.omega.reshape(shape),
        reason=field.reason.reshape(shape),
        predicted=predicted,
        point_tvc=_at_point(case, tank, predicted),
        ellipse=ellipse,
        ellipse_tvc=field.along(10.0 ** (ellipse[0] / 20.0), ellipse[1])[0] if ellipse.size else np.zeros(0),
        ellipse_omega=W,
    )


def _at_point(case: Case, tank: int, predicted: LimitCycle) -> float:
    """Return the greatest engine amplitude of the stable cycles at the paper's point; nan where there is none."""
    if not np.isfinite(predicted.gain) or float(case.autopilot.delay) + predicted.delay < 0.0:
        return np.nan
    if len(case.vehicle.tanks) > 1:
        return max((cycle.tvc_amplitude for cycle in predicted.coupled if cycle.stable), default=np.nan)
    one = DegradedCycles(case, tank, np.array([predicted.gain]), np.array([predicted.delay]))
    one.fill()
    return float(one.tvc[0])


def _angle(value: float) -> str:
    return f"{1e3 * value:.3f} mrad ({np.degrees(value):.3f} deg)"
