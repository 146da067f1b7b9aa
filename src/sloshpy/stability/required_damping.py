"""Least slosh damping that a tank needs: suprema over damping, never roots (the disc margin is a distance)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.case import Case, Criteria
from sloshpy.damping import DampingLaw
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL, greatest_growth
from sloshpy.stability.margins import loop_margins
from sloshpy.units import Array, BoolArray, IntArray

if TYPE_CHECKING:
    import xarray as xr

MOST_RATIO = 1.0  # critical slosh damping: the search ends here
LEVELS = 57  # damping values scanned, 0 and 1e-5 to 1 in steps of a quarter


@dataclass(frozen=True, kw_only=True)
class RequiredDamping:
    """Least damping ratios of one tank above which the loop is good; shape of the batch.

    neutral: for every larger damping the loop is stable. required: and the tank's slosh-related disc margin reaches
    `disc_margin`. 0 where none is needed, nan where none up to critical damping suffices.
    omega: frequency of the least slosh-related disc margin at the required damping, rad/s.
    source: the loop, whose own damping of this tank plays no part.
    """

    tank: str
    neutral: Array
    required: Array
    omega: Array
    disc_margin: float
    source: Loop

    def __str__(self) -> str:
        if np.ndim(self.required):
            return f"Required damping of {self.tank}: {np.size(self.required)} loops"
        if np.isnan(self.required):
            stable = (
                "no damping makes it stable"
                if np.isnan(self.neutral)
                else f"stable from {100.0 * self.neutral:.4f} % on"
            )
            return f"{self.tank}: {stable}; none up to critical gives a disc margin of {self.disc_margin:g}"
        if self.required == 0.0:
            return f"{self.tank}: needs no slosh damping for a disc margin of {self.disc_margin:g}"
        return (
            f"{self.tank}: neutral at {100.0 * float(self.neutral):.4f} %, disc margin {self.disc_margin:g} from "
            f"{100.0 * float(self.required):.4f} % on, at {float(self.omega) / 2.0 / np.pi:.4f} Hz"
        )

    def to_dataset(self) -> "xr.Dataset":
        """Return the damping ratios as an xarray Dataset with units in the attributes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        axes = [f"batch_{i}" for i in range(np.ndim(self.required))]
        return xr.Dataset(
            {
                "neutral": (axes, self.neutral, {"units": "1"}),
                "required": (axes, self.required, {"units": "1"}),
                "omega": (axes, self.omega, {"units": "rad/s"}),
            },
            attrs={"tank": self.tank, "disc_margin": self.disc_margin},
        )


def required_damping(case: Case, tank: str | int = 0, disc_margin: float | None = None) -> RequiredDamping:
    """Return the least damping of a tank, the other tanks as in the case at small amplitude.

    Args:
        case: vehicle, autopilot, criteria; fields may carry leading axes.
        tank: name or number of the tank.
        disc_margin: threshold of eq 24; default: the criterion of the case.
    """
    j = case.tank_index(tank)
    threshold = case.criteria.disc_margin if disc_margin is None else disc_margin
    return loop_required_damping(open_loop(case), case.criteria, j, threshold)


def loop_required_damping(
    loop: Loop, criteria: Criteria, tank: int, disc_margin: float, levels: int = LEVELS
) -> RequiredDamping:
    """Return the least damping of one tank of a loop or of a batch; see `required_damping`."""
    batch = loop.batch
    size = int(np.prod(batch))

    def shortfall(ratio: Array, index: IntArray) -> tuple[Array, Array]:
        """Return how far each loop is from stability (growth) and from the threshold (positive: short of it)."""
        one = _with_ratio(loop, index, tank, ratio)
        found = loop_margins(one.along(), criteria, crossings=False)
        margin = np.abs(found.slosh_disc_margin(tank)[0][..., 0])  # stability is judged by the growth
        return found.growth[..., 0], np.asarray(disc_margin - margin)

    axis = NEUTRAL * float(np.max(loop.plant.tank_frequency))  # a neutral pole, which rounding moves, does not grow
    every = np.arange(size)
    if np.all(greatest_growth(_with_ratio(loop, every, tank, np.full(size, MOST_RATIO))) >= axis):
        none = np.full(batch, np.nan)  # unstable however much this tank is damped: no need to search
        return RequiredDamping(
            tank=loop.plant.tanks[tank], neutral=none, required=none, omega=none, disc_margin=disc_margin, source=loop
        )
    grid = np.concatenate([[0.0], np.geomspace(1e-5, MOST_RATIO, levels - 1)])
    index, ratio = (x.ravel() for x in np.meshgrid(every, grid, indexing="ij"))
    growth, short = (x.reshape(size, levels) for x in shortfall(ratio, index))

    def growing(ratio: Array, index: IntArray) -> Array:
        return greatest_growth(_with_ratio(loop, index, tank, ratio)) - axis

    def lacking(ratio: Array, index: IntArray) -> Array:
        growth, short = shortfall(ratio, index)
        return np.where(growth < axis, np.maximum(short, -1e3), disc_margin)  # -inf where no minimum is the tank's

    neutral = supremum(growth >= axis, grid, growing)
    required = supremum((growth >= axis) | (short > 0.0), grid, lacking)
    omega = np.full(size, np.nan)
    known = np.flatnonzero(np.isfinite(required))
    if len(known):
        one = _with_ratio(loop, known, tank, required[known])
        omega[known] = loop_margins(one.along(), criteria, crossings=False).slosh_disc_margin(tank)[1][..., 0]
    return RequiredDamping(
        tank=loop.plant.tanks[tank],
        neutral=neutral.reshape(batch),
        required=required.reshape(batch),
        omega=omega.reshape(batch),
        disc_margin=disc_margin,
        source=loop,
    )


def joint_damping(case: Case) -> Array:
    """Return the damping at which all tanks together meet the disc margin, one ratio for each tank.

    Every tank's law is read at one common slosh amplitude: the least above which, for every larger one, the loop is
    stable and no slosh-related disc margin is below the criterion. The five steps hold the other tanks there, since in
    a limit cycle none of them is at rest. Where the laws do not suffice at any amplitude (a constant too small, data
    that end too early), each tank gets at least the least common ratio that does, so that a tank is judged by its own
    need and not by another's shortage. One tank alone keeps its small-amplitude damping.
    """
    laws = [tank.damping for tank in case.vehicle.tanks]
    small = open_loop(case).damping
    if len(laws) < 2:
        return small
    reaches = [_reach(law) for law in laws]
    most = max([reach for reach in reaches if np.isfinite(reach)], default=0.0)
    axis = NEUTRAL * max(float(tank.frequency) for tank in case.vehicle.tanks)
    grid = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, LEVELS - 1)])

    def at_amplitude(amplitude: Array) -> Array:
        columns = [law.ratio(np.clip(amplitude, law.smallest_amplitude, law.largest_amplitude)) for law in laws]
        return np.minimum(np.stack(columns, axis=-1), MOST_RATIO)

    def lacking(damping: Array) -> Array:
        found = loop_margins(open_loop(case, damping), case.criteria, crossings=False)
        own = np.any([found.related(j) for j in range(len(laws))], axis=0)
        least = np.min(np.where(own, found.minima.value, np.inf), axis=-1)
        short = np.where(np.isinf(least), -1.0, case.criteria.disc_margin - least)
        return np.where(found.growth < axis, short, np.maximum(np.abs(short), case.criteria.disc_margin))

    def least_of(damping: Callable[[Array], Array], levels: Array) -> float:
        bad = lacking(damping(levels))[None, :] > 0.0
        return float(supremum(bad, levels, lambda level, _: lacking(damping(level)))[0])

    if most > 0.0:
        amplitude = least_of(at_amplitude, grid * most)
        if not np.isnan(amplitude):
            return at_amplitude(np.asarray(amplitude))
    given = at_amplitude(np.asarray(most))

    def at_least(ratio: Array) -> Array:
        return np.maximum(given, np.asarray(ratio)[..., None])

    ratio = least_of(at_least, grid * MOST_RATIO)
    return given if np.isnan(ratio) else at_least(np.asarray(ratio))


def _reach(law: DampingLaw) -> float:
    """Return the amplitude in m at which a law's data end or it becomes critical; not finite for a constant."""
    return float(law.amplitude(MOST_RATIO)) if np.isinf(law.largest_amplitude) else law.largest_amplitude


def _with_ratio(loop: Loop, index: IntArray, tank: int, ratio: Array) -> Loop:
    """Return loops of the flattened batch, each with its own damping of one tank."""
    one = loop.take(index)
    damping = np.broadcast_to(one.damping, (*np.shape(ratio), one.damping.shape[-1])).copy()
    damping[..., tank] = ratio
    return replace(one, damping=damping)


def supremum(bad: BoolArray, grid: Array, function: Any) -> Array:
    """Return the greatest damping that is bad, refined between the last bad level and the next; 0 if none, nan if all.

    Args:
        bad: (size, levels), the verdict on the grid. function: positive where bad, of (ratio, index).
    """
    from scipy.optimize import elementwise  # 0.4 s: only when a requirement is wanted

    last = bad.shape[1] - 1 - np.argmax(bad[:, ::-1], axis=1)
    none, all_ = ~np.any(bad, axis=1), bad[:, -1]
    result = np.where(none, 0.0, np.nan)
    rows = np.flatnonzero(~none & ~all_)
    if len(rows):
        low, high = grid[last[rows]], grid[last[rows] + 1]
        found = elementwise.find_root(
            function, (low, high), args=(rows,), tolerances={"xrtol": 1e-11, "xatol": 1e-13}, maxiter=200
        )
        result[rows] = np.where(np.asarray(found.success), found.x, high)
    return result
