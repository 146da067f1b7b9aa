"""Root locus of the loop over an extra gain, fig 4, and the order of slosh pole and zero."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics.loop import open_loop
from sloshpy.dynamics.poles import closed_loop_eigenvalues, closed_loop_poles, open_loop_poles
from sloshpy.dynamics.states import system_matrix
from sloshpy.stability.nichols import loop_zeros
from sloshpy.units import Array, ComplexArray, Real

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class RootLocus:
    """Closed-loop poles over the extra loop gain.

    gain: (G,), amplitude ratio on top of the case's loop. branch: (G, N), rad/s, each column one pole followed by
    continuity from the open-loop poles. open_poles, zeros: rad/s. names: of the open-loop branches.
    slosh_order: per tank, its open-loop pole and the zero nearest to it, rad/s; under PD control a pole below its zero
    is driven unstable, one above it is stabilised.
    closed: poles at the case's own gain. drift_poles: neutral poles removed by structure.
    """

    case: Case
    damping: Array
    gain: Array
    branch: ComplexArray
    open_poles: ComplexArray
    zeros: ComplexArray
    slosh_order: dict[str, tuple[float, float]]
    closed: ComplexArray
    closed_names: tuple[str, ...]
    drift_poles: int

    def __str__(self) -> str:
        lines = [f"Root locus of {self.case.name}, {self.drift_poles} neutral drift poles removed by structure"]
        for name, values in (("open-loop pole", self.open_poles), ("zero", self.zeros)):
            lines += [f"  {name:15s} {v.real + 0.0:+.5f} {v.imag + 0.0:+.5f}j rad/s" for v in values if v.imag >= 0.0]
        for tank, (pole, zero) in self.slosh_order.items():
            place = "below" if pole < zero else "above"
            lines.append(f"  {tank}: slosh pole {place} its zero, {pole:.4f} and {zero:.4f} rad/s")
        for v, name in zip(self.closed, self.closed_names, strict=True):
            lines.append(f"  closed-loop     {v.real:+.5f} {v.imag:+.5f}j rad/s  {name}")
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return the branches as an xarray Dataset; real and imaginary parts apart, as NetCDF wants them."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "real": (["gain", "branch"], self.branch.real, {"units": "1/s"}),
                "imag": (["gain", "branch"], self.branch.imag, {"units": "rad/s"}),
            },
            coords={"gain": ("gain", self.gain, {"units": "1"})},
        )


def root_locus(case: Case, damping: Real | None = None, gain: Array | None = None) -> RootLocus:
    """Return the root locus of a case at given slosh damping (default: none, as fig 4).

    Args:
        case: one vehicle and autopilot, no batch.
        damping: slosh damping ratios, one for all tanks or one for each.
        gain: extra loop gains, increasing; default: 0.001 to 100.
    """
    single(case, "root_locus")
    loop = open_loop(case, 0.0 if damping is None else damping)
    gain = np.geomspace(1e-3, 1e2, 401) if gain is None else np.asarray(gain, dtype=float)
    pilot = case.autopilot.model_copy(update={"gain": np.asarray(case.autopilot.gain) * gain})
    gained = replace(loop, autopilot=pilot)
    values = closed_loop_eigenvalues(gained)
    start = np.linalg.eigvals(system_matrix(gained, closed=False)[0][0]).astype(complex)  # broken: the same at any gain
    poles = open_loop_poles(loop)
    closed, zeros = closed_loop_poles(loop), loop_zeros(loop)
    order = {}
    for tank, pole in zip(poles.tank, poles.value, strict=True):
        if tank is not None:
            nearest = zeros[np.argmin(np.abs(zeros - pole))]
            order[tank] = (float(pole.imag), float(np.abs(nearest.imag)))
    return RootLocus(
        case=case,
        damping=loop.damping,
        gain=gain,
        branch=_followed(start, values),
        open_poles=poles.value,
        zeros=zeros,
        slosh_order=order,
        closed=closed.value,
        closed_names=closed.name,
        drift_poles=loop.plant.drift_poles,
    )


def _followed(start: ComplexArray, values: ComplexArray) -> ComplexArray:
    """Order each row of poles so that every column is one branch: least total step from the row before."""
    from scipy.optimize import linear_sum_assignment  # 0.3 s: only when a locus is wanted

    branches = np.empty_like(values)
    before = start
    for g, row in enumerate(values):
        step = np.abs(before[:, None] - row[None, :])
        cost = np.where(np.isnan(step), 1e9, step)
        branches[g] = row[linear_sum_assignment(cost)[1]]
        before = np.where(np.isnan(branches[g]), before, branches[g])
    return branches
