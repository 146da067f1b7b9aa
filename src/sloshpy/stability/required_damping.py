"""Least slosh damping that a tank needs: suprema over damping, never roots (the disc margin is a distance)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.case import Case, Criteria
from sloshpy.damping.laws import MOST_DAMPING
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL, closed_loop_eigenvalues
from sloshpy.dynamics.response import transfer
from sloshpy.stability.family import sampled_family
from sloshpy.stability.margins import Margins, least_in, loop_margins
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.stability.touching import touching_critical_point, touching_level, with_ratio
from sloshpy.units import Array, BoolArray, IntArray

if TYPE_CHECKING:
    import xarray as xr

MOST_RATIO = MOST_DAMPING  # beyond it nothing is slosh: the search ends here
LEVELS = 38  # damping values scanned: 0, then in steps of a quarter, below a thousandth of three quarters
SMALL = 2  # coordinates of a plant whose response is a formula
BLOCK = 19  # of them at a time, from above
NARROW = 0.1  # of a resonance's relative width, which is about the damping: where a minimum is sought once more
PROOF = 1e-7  # relative: how far on both sides of a damping the verdict is asked that proves it


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
    grid = damping_levels(levels)
    search = _Search(
        loop=loop,
        criteria=criteria,
        tank=tank,
        shared_with=shared_with,
        until=until,
        threshold=disc_margin,
        axis=axis,
    )
    scan = search.from_above(grid)
    neutral = supremum(scan.growth >= axis, grid, search.growing, search.neutral_candidate)
    omega = np.full(size, np.nan)

    def candidate(low: Array, high: Array, index: IntArray) -> Array:
        omega[index], ratio = search.required_candidate(low, high, index, scan, grid)
        return ratio

    required = supremum(search.short(scan.growth, scan.margin) > 0.0, grid, search.lacking, candidate)
    known = np.flatnonzero(np.isfinite(required) & np.isnan(omega))
    if len(known):
        omega[known] = search.own_margin(required[known], known).omega
    return RequiredDamping(
        tank=loop.plant.tanks[tank],
        neutral=neutral.reshape(batch),
        required=required.reshape(batch),
        omega=omega.reshape(batch),
        disc_margin=disc_margin,
        source=loop,
        shared_with=tuple(loop.plant.tanks[j] for j in shared_with),
    )


def damping_levels(count: int) -> Array:
    """Return so many damping ratios from 0 to `MOST_RATIO` that are scanned, a fifth of them below a thousandth."""
    few = (count + 2) // 5
    low, high = np.geomspace(1e-5, 1e-3, few + 1)[:-1], np.geomspace(1e-3, MOST_RATIO, count - 1 - few)
    return np.concatenate([[0.0], low, high])


@dataclass(frozen=True)
class _Found:
    """What a tank shows at some dampings: growth of the loop in 1/s, its least distance that counts, where in rad/s."""

    growth: Array
    margin: Array
    omega: Array


@dataclass(frozen=True, kw_only=True)
class _Search:
    """What is asked of a loop at many dampings of one tank; `axis` is the growth that counts as none, 1/s.

    shared_with, until: numbers of the tanks whose minima count too, and up to which damping of this one.
    """

    loop: Loop
    criteria: Criteria
    tank: int
    shared_with: tuple[int, ...]
    until: float
    threshold: float
    axis: float

    def own_margin(self, ratio: Array, index: IntArray) -> _Found:
        """Return what the tank shows at dampings (K,), each of a loop of the flattened batch, minima below threshold.

        A plant of one tank on a rigid vehicle costs next to nothing; a larger one is solved once for all its dampings.
        """
        one = with_ratio(self.loop, index, self.tank, ratio)
        if self.loop.plant.mass.shape[-1] <= SMALL:
            return self._own(loop_margins(one.along(), self.criteria, crossings=False), ratio)
        found = _Found(*(np.empty(len(ratio)) for _ in range(3)))
        for row in np.unique(index):
            at = np.flatnonzero(index == row)
            curves = sampled_family(self.loop.take(row), self.tank, ratio[at], self.criteria, self.threshold)
            minima = loop_margins(one.take(at).along(), self.criteria, False, curves, self.threshold)
            part = self._own(minima, ratio[at])
            found.growth[at], found.margin[at], found.omega[at] = part.growth, part.margin, part.omega
        return found

    def _own(self, found: Margins, ratio: Array) -> _Found:
        margin, omega = found.slosh_disc_margin(self.tank)
        if self.shared_with:
            more, at = found.slosh_disc_margin(*self.shared_with)
            nearer = (np.abs(more) < np.abs(margin)) & (ratio <= self.until)[..., None]
            margin, omega = np.where(nearer, more, margin), np.where(nearer, at, omega)
        return _Found(growth=found.growth[..., 0], margin=np.abs(margin[..., 0]), omega=omega[..., 0])

    def growing(self, ratio: Array, index: IntArray) -> Array:
        """Return the growth beyond `axis`, 1/s."""
        return greatest_growth(with_ratio(self.loop, index, self.tank, ratio)) - self.axis

    def short(self, growth: Array, margin: Array) -> Array:
        """Return how far a margin is below the threshold; all of the threshold where the loop grows."""
        # inf where no minimum is the tank's
        return np.where(growth < self.axis, np.maximum(self.threshold - margin, -1e3), self.threshold)

    def lacking(self, ratio: Array, index: IntArray) -> Array:
        """Return how far the tank's margin is below the threshold."""
        found = self.own_margin(ratio, index)
        return self.short(found.growth, found.margin)

    def from_above(self, grid: Array) -> _Found:
        """Return what every loop shows on levels of damping, (size, levels), from the highest down.

        Below the level where a loop is found unstable nothing is asked any more: it grows without end there.
        """
        shape = (int(np.prod(self.loop.batch)), len(grid))
        scan = _Found(growth=np.full(shape, np.inf), margin=np.zeros(shape), omega=np.full(shape, np.nan))
        rows, top = np.arange(shape[0]), shape[1]
        while top > 0 and len(rows):
            levels = np.arange(max(0, top - BLOCK), top)
            index, ratio = np.repeat(rows, len(levels)), np.tile(grid[levels], len(rows))
            found, at = self.own_margin(ratio, index), (index, np.tile(levels, len(rows)))
            scan.growth[at], scan.margin[at], scan.omega[at] = found.growth, found.margin, found.omega
            rows = rows[~np.any(scan.growth[np.ix_(rows, levels)] >= self.axis, axis=1)]
            top = int(levels[0])
        return scan

    def required_candidate(
        self, low: Array, high: Array, index: IntArray, scan: _Found, grid: Array
    ) -> tuple[Array, Array]:
        """Return frequency and damping at which the tank's least minimum reaches the threshold between two levels.

        nan where that is not proved.
        """
        below = np.searchsorted(grid, low)
        growth, margin, omega = (x[index, below] for x in (scan.growth, scan.margin, scan.omega))
        above = scan.margin[index, below + 1]
        signed = np.where(growth < self.axis, margin, -margin)
        with np.errstate(divide="ignore", invalid="ignore"):  # no minimum of the tank's at one end: start in the middle
            share = np.nan_to_num((self.threshold - signed) / (above - signed), nan=0.5)
        start = omega, _between(low, high, np.clip(share, 0.05, 0.95))
        at, ratio = touching_level(
            self.loop, index, self.tank, self.threshold, self.criteria, start, np.array([low, high])
        )
        proved = self._proved(self.lacking, ratio, PROOF * ratio, index)
        return self._least_beside(at, proved, index), proved

    def _least_beside(self, omega: Array, ratio: Array, index: IntArray) -> Array:
        """Return where the minimum beside a frequency lies at a damping, rad/s; nan where there is none.

        Its value hardly depends on where, the gain and the phase that lead from there to the critical point do.
        """
        known = np.flatnonzero(np.isfinite(ratio))
        found = np.full(len(ratio), np.nan)
        if len(known):
            one = with_ratio(self.loop, index[known], self.tank, ratio[known])

            def squared(w: Array, row: IntArray) -> Array:
                L = transfer(one.take(row), 1j * w).loop
                return nichols_disc_margin(L, self.criteria.gain_margin, self.criteria.phase_margin) ** 2

            w, aside = omega[known], 1.0 + NARROW * np.maximum(ratio[known], 1e-6)
            found[known] = least_in(squared, (w / aside, w, w * aside), np.arange(len(known)))[0]
        return found

    def neutral_candidate(self, low: Array, high: Array, index: IntArray) -> Array:
        """Return where a pole crosses the imaginary axis between two dampings; nan where that is not proved."""
        pair = with_ratio(self.loop, np.tile(index, 2), self.tank, np.concatenate([low, high]))
        poles = closed_loop_eigenvalues(pair).reshape(2, len(index), -1)
        first = np.nanargmax(np.where(poles.imag >= 0.0, poles.real, -np.inf), axis=-1)
        pole = np.take_along_axis(poles, first[..., None], axis=-1)[..., 0]
        share = np.clip(pole[0].real / (pole[0].real - pole[1].real), 0.05, 0.95)
        start = np.maximum((1.0 - share) * pole[0].imag + share * pole[1].imag, 1e-300), _between(low, high, share)
        ratio = touching_critical_point(self.loop, index, self.tank, start, np.array([low, high]))
        return self._proved(self.growing, ratio, PROOF * ratio + 10.0 * NEUTRAL, index)

    def _proved(self, function: Any, ratio: Array, apart: Array, index: IntArray) -> Array:
        """Return the dampings just below which the function is positive and just above which it is not, else nan."""
        known = np.flatnonzero(np.isfinite(ratio))
        proved = np.full(len(ratio), np.nan)
        if len(known):
            ends = np.concatenate([np.maximum(ratio - apart, 0.0)[known], (ratio + apart)[known]])
            below, above = function(ends, np.tile(index[known], 2)).reshape(2, -1)
            proved[known] = np.where((below > 0.0) & (above <= 0.0), ratio[known], np.nan)
        return proved


def _between(low: Array, high: Array, share: Array) -> Array:
    """Return a damping between two, geometrically but from nothing."""
    return np.where(low > 0.0, np.maximum(low, 1e-300) ** (1.0 - share) * high**share, share * high)


def supremum(bad: BoolArray, grid: Array, function: Any, candidate: Any = None) -> Array:
    """Return the greatest damping that is bad, refined between the last bad level and the next; 0 if none, nan if all.

    Args:
        bad: (size, levels), the verdict on the grid. function: positive where bad, of (ratio, index).
        candidate: of (low, high, index): a fast way to where the function changes sign, nan where it finds nothing.
    """
    from scipy.optimize import elementwise  # 0.4 s: only when a requirement is wanted

    last = bad.shape[1] - 1 - np.argmax(bad[:, ::-1], axis=1)
    none, all_ = ~np.any(bad, axis=1), bad[:, -1]
    result = np.where(none, 0.0, np.nan)
    rows = np.flatnonzero(~none & ~all_)
    if candidate is not None and len(rows):
        result[rows] = candidate(grid[last[rows]], grid[last[rows] + 1], rows)
        rows = rows[np.isnan(result[rows])]
    if len(rows):
        low, high = grid[last[rows]], grid[last[rows] + 1]
        found = elementwise.find_root(
            function, (low, high), args=(rows,), tolerances={"xrtol": 1e-11, "xatol": 1e-13}, maxiter=200
        )
        result[rows] = np.where(np.asarray(found.success), found.x, high)
    return result
