"""Least slosh damping that a tank needs: suprema over damping, never roots (the disc margin is a distance)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case, Criteria
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.stability.damping_search import LEVELS, MOST_RATIO, DampingSearch, damping_levels
from sloshpy.stability.touching import with_ratio
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr

# relative: where the other tanks are held, all just meet the margin, or are just stable: there rounding lacks nothing
SLACK = 3e-9


@dataclass(frozen=True, kw_only=True)
class RequiredDamping:
    """Least damping ratios of one tank above which the loop is good; shape of the batch.

    neutral: for every larger damping up to 0.3, beyond which nothing is slosh, the loop is stable. required: and the
    tank's slosh-related disc margin reaches `disc_margin`. 0 where none is needed, nan where 0.3 does not suffice.
    omega: frequency of the least slosh-related disc margin at the required damping, rad/s.
    source: the loop, whose own damping of this tank plays no part.
    shared_with: of one loop, tanks whose minima count too, see `joint_required_damping`. own: then what the tank's own
    minima alone require.
    """

    tank: str
    neutral: Array
    required: Array
    omega: Array
    disc_margin: float
    source: Loop
    shared_with: tuple[str, ...] = ()
    own: "RequiredDamping | None" = None

    @property
    def counted(self) -> tuple[int, ...]:
        """Numbers of the tanks whose minima count: this one first."""
        names = self.source.plant.tanks
        return tuple(names.index(name) for name in (self.tank, *self.shared_with))

    def __str__(self) -> str:
        if np.ndim(self.required):
            return f"Required damping of {self.tank}: {np.size(self.required)} loops"
        if np.isnan(self.required):
            stable = (
                f"unstable at {100.0 * MOST_RATIO:g} % damping"
                if np.isnan(self.neutral)
                else f"stable from {100.0 * self.neutral:.4f} % on"
            )
            most = f"{100.0 * MOST_RATIO:g} %"
            return f"{self.tank}: {stable}; none up to {most} gives a disc margin of {self.disc_margin:g}"
        if self.required == 0.0:
            return f"{self.tank}: needs no slosh damping for a disc margin of {self.disc_margin:g}"
        hertz = float(self.omega) / 2.0 / np.pi
        where = "where its minimum ends" if np.isnan(hertz) else f"at {hertz:.4f} Hz"
        neutral = f"neutral at {100.0 * float(self.neutral):.4f} %" if self.neutral > 0.0 else "stable without"
        return (
            f"{self.tank}: {neutral}, disc margin {self.disc_margin:g} from {100.0 * float(self.required):.4f} % on, "
            f"{where}"
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
    loop: Loop,
    criteria: Criteria,
    tank: int,
    disc_margin: float,
    levels: int = LEVELS,
    shared_with: tuple[int, ...] = (),
    until: float = np.inf,
) -> RequiredDamping:
    """Return the least damping of one tank of a loop or of a batch; see `required_damping`.

    Args:
        loop: one loop or a batch. criteria: gain and phase margin of eq 24. tank: its number.
        disc_margin: threshold of eq 24. levels: how many dampings are scanned.
        shared_with: numbers of the tanks whose minima count too.
        until: damping up to which they do.
    """
    batch = loop.batch
    size = int(np.prod(batch))
    axis = NEUTRAL * float(np.max(loop.plant.tank_frequency))  # a neutral pole, which rounding moves, does not grow
    every = np.arange(size)
    if np.all(greatest_growth(with_ratio(loop, every, tank, np.full(size, MOST_RATIO))) >= axis):
        none = np.full(batch, np.nan)  # unstable however much this tank is damped: no need to search
        return RequiredDamping(
            tank=loop.plant.tanks[tank], neutral=none, required=none, omega=none, disc_margin=disc_margin, source=loop
        )
    search = DampingSearch(
        at=lambda ratio, index: with_ratio(loop, index, tank, ratio),
        size=size,
        moved=(tank,),
        counted=(tank,),
        criteria=criteria,
        shared_with=shared_with,
        until=until,
        threshold=disc_margin,
        axis=2.0 * axis,
        slack=SLACK,
    )
    neutral, required, omega = search.suprema(damping_levels(levels))
    return RequiredDamping(
        tank=loop.plant.tanks[tank],
        neutral=neutral.reshape(batch),
        required=required.reshape(batch),
        omega=omega.reshape(batch),
        disc_margin=disc_margin,
        source=loop,
        shared_with=tuple(loop.plant.tanks[j] for j in shared_with),
    )
