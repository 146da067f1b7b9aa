"""Pitch and yaw in time together: the slosh masses move in their plane, damped by their speed.

An adaptive integrator (DOP853) with its step bounded, since it steps over the kink of |v| v else. The delay is its Pade
approximation of order 8, whose phase error lies far below the tolerance at any slosh frequency.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case, continuous
from sloshpy.dynamics.loop import open_loop
from sloshpy.dynamics.states import system_matrix
from sloshpy.errors import OutsideValidity
from sloshpy.simulation.envelope import Envelope, settled_envelope
from sloshpy.simulation.state_rows import engine_row, slosh_rows
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr

STEPS = 40  # a cycle at least, of the integrator and of the history


@dataclass(frozen=True, kw_only=True)
class TwoAxisHistory:
    """Slosh and engine angles of pitch and yaw over time.

    time: (T,), s. slosh: (T, n_tanks, 2), m. tvc: (T, 2), rad.
    """

    pitch: Case
    yaw: Case
    time: Array
    slosh: Array
    tvc: Array

    def slosh_envelope(self, tank: int = 0, axis: int = 0) -> Envelope:
        """Return amplitude in m and frequency of a tank's settled slosh in pitch (0) or yaw (1)."""
        return settled_envelope(self.time, self.slosh[:, tank, axis])

    def half_axes(self, tank: int = 0) -> tuple[float, float]:
        """Return the half axes in m of the ellipse of a tank's last twentieth of the run, the greater first."""
        last = self.slosh[-len(self.time) // 20 :, tank]
        reach = np.hypot(last[:, 0], last[:, 1])
        return float(np.max(reach)), float(np.min(reach))

    def __str__(self) -> str:
        lines = [f"{self.pitch.name} in two axes: {self.time[-1]:.1f} s"]
        for j, tank in enumerate(self.pitch.vehicle.tanks):
            a, b = self.half_axes(j)
            lines.append(f"  {tank.name} slosh at the end between {b:.4f} and {a:.4f} m from the axis")
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return the histories as an xarray Dataset over time."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "slosh": (["time", "tank", "axis"], self.slosh, {"units": "m"}),
                "tvc": (["time", "axis"], self.tvc, {"units": "rad"}),
            },
            coords={
                "time": ("time", self.time, {"units": "s"}),
                "tank": [t.name for t in self.pitch.vehicle.tanks],
                "axis": ["pitch", "yaw"],
            },
        )


def simulate_two_axes(
    pitch: Case,
    yaw: Case | None = None,
    duration: float = 300.0,
    initial_slosh: Array | None = None,
    initial_rate: Array | None = None,
) -> TwoAxisHistory:
    """Simulate pitch and yaw together from displaced slosh, each with its loop, coupled by the dampers.

    Args:
        pitch: one vehicle and autopilot.
        yaw: likewise, with the same tanks; default: as in pitch.
        duration: s.
        initial_slosh: (n_tanks, 2), m; default: 0.01 m in pitch.
        initial_rate: (n_tanks, 2), m/s; default: in yaw a hundredth of the start in pitch times its frequency. Without
            any the motion has no angular momentum, and equal axes keep it in one plane for ever.

    Raises:
        OutsideValidity: an actuator limit, or a motion beyond a law's data.
    """
    from scipy.integrate import solve_ivp  # 0.3 s: only where it is asked for

    cases = (pitch, pitch if yaw is None else yaw)
    for case in cases:
        single(case, "simulate_two_axes")
        continuous(case, "simulate_two_axes")
        limits = case.autopilot.actuator
        if limits is not None and limits.limited:
            raise OutsideValidity("two axes are simulated without actuator limits or dead band: leave the limits out")
    laws = [(tank.damping, float(tank.frequency)) for tank in pitch.vehicle.tanks]
    n = len(laws)
    loops = [open_loop(case, 0.0) for case in cases]
    A = [system_matrix(loop)[0] for loop in loops]
    rows = [slosh_rows(loop, len(a)) for loop, a in zip(loops, A, strict=True)]
    engine = [engine_row(loop, len(a)) for loop, a in zip(loops, A, strict=True)]
    cut = len(A[0])
    start = np.array([[0.01, 0.0]] * n) if initial_slosh is None else np.asarray(initial_slosh, dtype=float)
    turning = np.stack([np.zeros(n), [0.01 * a * w for a, (_, w) in zip(start[:, 0], laws, strict=True)]], axis=-1)
    rate = turning if initial_rate is None else np.asarray(initial_rate, dtype=float)

    def slope(_: float, x: Array) -> Array:
        parts = x[:cut], x[cut:]
        v = np.stack([r.velocity @ part for r, part in zip(rows, parts, strict=True)], axis=-1)
        speed = np.hypot(v[:, 0], v[:, 1])
        moving = zip(laws, speed, strict=True)
        grip = np.array([float(law.acceleration(u, w)) / u if u > 0.0 else 0.0 for (law, w), u in moving])
        moved = [a @ part + (grip * v[:, k]) @ rows[k].push for k, (a, part) in enumerate(zip(A, parts, strict=True))]
        return np.concatenate(moved)

    fastest = 2.0 * np.pi / max(w for _, w in laws) / STEPS
    time = np.linspace(0.0, duration, int(np.ceil(duration / fastest)) + 1)
    x0 = np.concatenate([start[:, k] @ rows[k].displacement + rate[:, k] @ rows[k].velocity for k in range(2)])
    run = solve_ivp(slope, (0.0, duration), x0, "DOP853", time, rtol=1e-9, atol=1e-12, max_step=fastest)
    if not run.success or np.any(np.isnan(run.y)):
        raise OutsideValidity(f"the run stopped at {run.t[-1]:.1f} s: {run.message}; is it beyond the damping data?")
    parts = run.y[:cut], run.y[cut:]
    return TwoAxisHistory(
        pitch=cases[0],
        yaw=cases[1],
        time=time,
        slosh=np.stack([(r.displacement @ part).T for r, part in zip(rows, parts, strict=True)], axis=-1),
        tvc=np.stack([row @ part for row, part in zip(engine, parts, strict=True)], axis=-1),
    )
