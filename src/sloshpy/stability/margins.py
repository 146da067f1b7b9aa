"""Every crossing and every minimum of eq 24, each with the mode it belongs to, signed by closed-loop stability."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case, Criteria
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL, unstable_count
from sloshpy.dynamics.response import frequency_sensitivity, transfer
from sloshpy.stability.nichols import Curves, least_beside, nichols_disc_margin, sampled, valley_samples
from sloshpy.units import Array, BoolArray, IntArray, Real

if TYPE_CHECKING:
    import xarray as xr

RIGID = "rigid body"
AUDIBLE = np.log(100.0)  # phase crossings beyond +-40 dB are no margins: undamped poles and zeros, wrapped delay
DISTANT = 4.0  # minima of eq 24 beyond this are listed in data, not on the screen
FOLLOWS = 0.3  # of a slosh frequency: below, a mass follows the body (its damper, at 10 %, gives 6 % of the force)
# a point belongs to a tank whose share is at least this part of the greatest: a half, where rounding does not decide
RELATED_SHARE = 0.5 * (1.0 - 1e-6)


@dataclass(frozen=True, kw_only=True)
class Points:
    """Points on the loop's curves: batch axes first, the points of each loop last, filled with nan.

    omega: rad/s. value: what was found there. share: (..., K, n_groups), how the point follows each group:
    by how many percent the frequency of the degraded, neutral loop rises when the group's frequency rises by 1 %.
    """

    omega: Array
    value: Array
    share: Array


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Margins of one loop or of a batch; nothing here can be read without `stable`.

    stable: closed-loop stability by poles, shape of the batch. growth: greatest real part of a pole, 1/s.
    witness: the same by encirclement count, for one loop only (None for a batch); see `trusted`.
    minima: every local minimum of eq 24, least first; with aerodynamics also the curve's static end, where it is one.
    gain_crossings: where |L| = 1, value = phase margin in rad
    (positive: more lag is needed). phase_crossings: odd multiples of 180 deg, value = gain margin as the ratio 1/|L|,
    within 40 dB.
    groups: names of the shares' last axis: slosh of each tank, bending modes, the rigid body with its controller.
    source, criteria: what they were made from.
    folded: a digital autopilot's sampler folds so much into the loop that none of this holds; see `stability.folding`.
    """

    stable: BoolArray
    growth: Array
    witness: bool | None
    minima: Points
    gain_crossings: Points
    phase_crossings: Points
    groups: tuple[str, ...]
    source: Loop
    criteria: Criteria
    folded: bool = False

    @property
    def neutral(self) -> BoolArray:
        """Whether a pole lies on the imaginary axis within rounding: neither poles nor encirclements can say more."""
        scale = np.max(self.source.plant.tank_frequency, axis=-1, initial=0.0)
        return np.asarray(np.abs(self.growth) <= NEUTRAL * scale)

    @property
    def trusted(self) -> bool:
        """Whether poles and encirclement count agree, where both were asked and can tell, and nothing is folded in."""
        if self.folded:
            return False
        return self.witness is None or bool(self.neutral) or bool(self.witness == self.stable)

    @property
    def nichols_disc_margin(self) -> Array:
        """Least disc margin of eq 24, negative where the closed loop is unstable; shape of the batch."""
        return np.asarray(np.where(self.stable, 1.0, -1.0) * self.minima.value[..., 0])

    def mode(self, points: Points) -> IntArray:
        """Return the index of the group each point belongs to, the shape of the points."""
        return np.asarray(np.argmax(np.where(np.isnan(points.share), -np.inf, points.share), axis=-1))

    def related(self, *tanks: int) -> BoolArray:
        """Return which minima are slosh-related for a tank: its share is at least half of the greatest share.

        For several tanks: which are related to one of them at least.
        """
        share = self.minima.share
        own = share[..., list(tanks)]
        with np.errstate(invalid="ignore"):
            return np.asarray(
                np.any((own >= RELATED_SHARE * np.max(share, axis=-1, keepdims=True)) & (own > 0.0), axis=-1)
            )

    def slosh_disc_margin(self, *tanks: int) -> tuple[Array, Array]:
        """Return the least disc margin among the minima of tanks, signed, and where in rad/s; inf and nan if none."""
        value = np.where(self.related(*tanks), self.minima.value, np.inf)
        k = np.argmin(value, axis=-1)[..., None]
        least = np.take_along_axis(value, k, axis=-1)[..., 0]
        omega = np.where(np.isfinite(least), np.take_along_axis(self.minima.omega, k, axis=-1)[..., 0], np.nan)
        return np.where(self.stable, least, -least), omega

    def __str__(self) -> str:
        if np.ndim(self.stable):
            return f"Margins of {np.size(self.stable)} loops, {np.sum(~self.stable)} unstable"
        head = (
            "NEUTRAL"
            if self.neutral
            else "stable"
            if self.stable
            else f"UNSTABLE, grows at {float(self.growth):.4g} 1/s"
        )
        return "\n".join([f"{head}; nichols disc margin {float(self.nichols_disc_margin):+.4f}", *self.lines()])

    def lines(self) -> list[str]:
        """Return the minima and crossings of one loop as lines of text, distant minima left out."""
        unstable = "  distances of a loop that is not stable from the critical point, not margins:"
        lines = [] if self.stable else [unstable]
        for name, points, unit in (
            ("disc margin", self.minima, ""),
            ("gain margin", self.phase_crossings, "dB"),
            ("phase margin", self.gain_crossings, "deg"),
        ):
            for omega, value, mode in self.listed(points):
                shown = in_unit(value, unit)
                if points is not self.minima or shown < DISTANT:
                    at = f"at {omega / 2 / np.pi:.4f} Hz ({omega:.4f} rad/s)"
                    lines.append(f"  {name:12s} {shown:9.4f} {unit:3s} {at}  {mode}")
        return lines

    def listed(self, points: Points) -> list[tuple[float, float, str]]:
        """Return frequency in rad/s, value and mode of the points of one loop."""
        mode = self.mode(points)
        found = np.flatnonzero(np.isfinite(points.omega))
        return [(float(points.omega[k]), float(points.value[k]), self.groups[int(mode[k])]) for k in found]

    def to_dataset(self) -> "xr.Dataset":
        """Return minima and crossings as an xarray Dataset with units in the attributes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        axes = [f"batch_{i}" for i in range(np.ndim(self.stable))]
        data: dict[str, object] = {
            "stable": (axes, self.stable),
            "growth": (axes, self.growth, {"units": "1/s"}),
            "nichols_disc_margin": (axes, self.nichols_disc_margin, {"units": "1"}),
        }
        for name, points, unit in (
            ("minimum", self.minima, "1"),
            ("gain_crossing", self.gain_crossings, "rad"),
            ("phase_crossing", self.phase_crossings, "1"),
        ):
            data[f"{name}_omega"] = ([*axes, name], points.omega, {"units": "rad/s"})
            data[f"{name}_value"] = ([*axes, name], points.value, {"units": unit})
            data[f"{name}_share"] = ([*axes, name, "group"], points.share, {"units": "1"})
        return xr.Dataset(data, coords={"group": list(self.groups)})


def in_unit(value: float, unit: str) -> float:
    """Return an amplitude ratio in "dB", an angle in "deg", anything else as it is."""
    if unit == "dB":
        return float(20.0 * np.log10(value))
    return float(np.degrees(value)) if unit == "deg" else value


def margins(case: Case, damping: Real | None = None, amplitude: Real | None = None) -> Margins:
    """Return the margins of a case at given slosh damping or amplitude (default: small amplitude), eq 24.

    Args:
        case: vehicle, autopilot and criteria; fields may carry leading axes.
        damping: slosh damping ratios, one for all tanks or (..., n_tanks).
        amplitude: slosh amplitudes in m, likewise.
    """
    return loop_margins(open_loop(case, damping, amplitude), case.criteria)


def loop_margins(
    loop: Loop, criteria: Criteria, crossings: bool = True, curves: Curves | None = None, below: float = np.inf
) -> Margins:
    """Return the margins of a loop or of a batch of loops; see `margins`.

    Args:
        loop: one loop or a batch.
        criteria: gain and phase margin of eq 24.
        crossings: find gain and phase crossings too, not the minima alone.
        curves: as dense as those of `sampled`, where they are known already.
        below: minima that lie above this may be left out.
    """
    if curves is None:
        curves = sampled(loop, criteria.gain_margin, criteria.phase_margin)
    batch, growth = loop.batch, greatest_growth(loop)
    lists = [(*_minima(loop, curves, criteria, below), True)]
    for found in _crossings(loop, curves) if crossings else ((np.zeros(0, dtype=int), np.zeros(0), np.zeros(0)),) * 2:
        lists.append((*found, False))
    points = [_padded(batch, i, w, v, mode_shares(loop, i, w), by_value) for i, w, v, by_value in lists]
    return Margins(
        stable=growth < 0.0,
        growth=growth,
        witness=None if batch else unstable_count(loop) == 0,
        minima=points[0],
        gain_crossings=points[1],
        phase_crossings=points[2],
        groups=(*loop.plant.groups[loop.plant.first_tank :], RIGID),
        source=loop,
        criteria=criteria,
    )


def _minima(loop: Loop, curves: Curves, criteria: Criteria, below: float) -> tuple[IntArray, Array, Array]:
    """Return loop, frequency and value of every local minimum of eq 24, each refined in its bracket."""
    GM, PM = criteria.gain_margin, criteria.phase_margin

    def squared(omega: Array, index: IntArray) -> Array:
        return nichols_disc_margin(transfer(loop.take(index), 1j * omega).loop, GM, PM) ** 2

    sample = nichols_disc_margin(curves.loop, GM, PM)
    k = np.flatnonzero(valley_samples(sample, curves.index) & (least_beside(sample) <= below))
    owner = curves.index[k]
    omega, value = least_in(squared, (curves.omega[k - 1], curves.omega[k], curves.omega[k + 1]), owner)
    if loop.plant.velocity_only:  # the air makes the static gain finite: the curve may be nearest at its start
        first = _nearest_at_the_start(curves, GM, PM)
        owner, omega = np.append(owner, curves.index[first]), np.append(omega, curves.omega[first])
        value = np.append(value, nichols_disc_margin(curves.loop[first], GM, PM) ** 2)
    return owner, omega, np.sqrt(np.maximum(value, 0.0))


def least_in(
    squared: Callable[[Array, IntArray], Array], bracket: tuple[Array, Array, Array], owner: IntArray
) -> tuple[Array, Array]:
    """Return where a function is least in each bracket, the middle below both ends, and its value there.

    Newton's method on values a thousandth of the bracket apart, kept in the bracket by halving it; where it does not
    settle below the middle, bracketing.
    """
    low, x, high = (np.log(w) for w in bracket)
    h = 5e-4 * (high - low)
    offset = np.array([-1.0, 0.0, 1.0])
    settled, value, first = np.zeros(len(x), dtype=bool), np.full(len(x), np.nan), np.full(len(x), np.nan)
    todo = np.arange(len(x))
    for _ in range(30):
        at = x[todo, None] + h[todo, None] * offset
        D = squared(np.exp(at), np.broadcast_to(owner[todo, None], at.shape))
        bend, slope = D[:, 2] - 2.0 * D[:, 1] + D[:, 0], 0.5 * (D[:, 2] - D[:, 0])
        first[todo], value[todo] = np.where(np.isnan(first[todo]), D[:, 1], first[todo]), D[:, 1]
        low[todo], high[todo] = np.where(slope < 0.0, x[todo], low[todo]), np.where(slope > 0.0, x[todo], high[todo])
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = x[todo] - slope / bend * h[todo]
        inside = (bend > 0.0) & (newton >= low[todo]) & (newton <= high[todo])
        step = np.where(inside, newton, 0.5 * (low[todo] + high[todo])) - x[todo]
        done = inside & (np.abs(step) < 1e-3 * h[todo])
        settled[todo[done]] = True
        x[todo] += step
        todo = todo[~done]
        if len(todo) == 0:
            break
    settled &= value <= first
    rest = np.flatnonzero(~settled)
    omega = np.exp(x)
    if len(rest):
        from scipy.optimize import elementwise  # 0.4 s: only when margins are wanted

        tolerances = {"xrtol": 1e-11, "frtol": 1e-15}
        inner = (bracket[0][rest], bracket[1][rest], bracket[2][rest])
        found = elementwise.find_minimum(squared, inner, args=(owner[rest],), tolerances=tolerances)
        omega[rest], value[rest] = np.asarray(found.x), np.asarray(found.f_x)
    return omega, value


def _crossings(loop: Loop, curves: Curves) -> list[tuple[IntArray, Array, Array]]:
    """Return loop, frequency and margin of every gain crossing (rad) and of every phase crossing (ratio)."""
    from scipy.optimize import elementwise  # as above

    def gain(omega: Array, index: IntArray) -> Array:
        return np.log(np.abs(transfer(loop.take(index), 1j * omega).loop))

    def phase(omega: Array, index: IntArray) -> Array:
        return np.asarray(np.angle(-transfer(loop.take(index), 1j * omega).loop), dtype=float)

    pairs = curves.pairs()
    log_gain, angle = np.log(np.abs(curves.loop)), np.angle(-curves.loop)
    at_gain = pairs[log_gain[pairs] * log_gain[pairs + 1] <= 0.0]
    turned = (angle[pairs] * angle[pairs + 1] <= 0.0) & (np.abs(angle[pairs + 1] - angle[pairs]) < np.pi)
    # a loop without lead or lag runs along -180 deg: rounding about it is no crossing
    turned &= np.maximum(np.abs(angle[pairs]), np.abs(angle[pairs + 1])) > 1e-9
    found = []
    for function, at in ((gain, at_gain), (phase, pairs[turned])):
        index, ends = curves.index[at], (curves.omega[at], curves.omega[at + 1])
        omega = np.asarray(elementwise.find_root(function, ends, args=(index,), tolerances={"xrtol": 1e-14}).x)
        L = transfer(loop.take(index), 1j * omega).loop
        if function is gain:
            found.append((index, omega, np.asarray(np.angle(-L), dtype=float)))
        else:
            heard = np.abs(np.log(np.abs(L))) < AUDIBLE
            found.append((index[heard], omega[heard], 1.0 / np.abs(L[heard])))
    return found


def _nearest_at_the_start(curves: Curves, gain_margin: float, phase_margin: float) -> IntArray:
    """Return the first sample of each curve that runs away from the critical point from there on.

    It lies a hundred times below the slowest pole or zero and stands for all lower frequencies.
    """
    distance = nichols_disc_margin(curves.loop, gain_margin, phase_margin)
    starts = np.flatnonzero(np.append(True, curves.index[1:] != curves.index[:-1])[:-1])
    return np.asarray(starts[distance[starts] < distance[starts + 1]])


def mode_shares(loop: Loop, index: IntArray, omega: Array) -> Array:
    """Return how the neutral frequency at each point follows each mode's own frequency, and the remainder, (K, n+1).

    Degrade the loop by a constant k so that k L(jw) = -1: its neutral frequency moves with w_j by
    d ln w / d ln w_j = -(dL/d ln w_j) / (dL/d ln s). Scaling every frequency and rate scales w, so the shares sum to 1
    with the rigid body's and its controller's as the remainder.

    Far below its own frequency a slosh mass follows the body and its damping tells nothing: it has no share there, or
    the static margin of a vehicle in the air would be charged to a tank.
    """
    if len(index) == 0:
        return np.zeros((0, loop.plant.mass.shape[-1] - loop.plant.first_tank + 1))
    one, s = loop.take(index), 1j * omega
    sensitivity = frequency_sensitivity(one, s)
    h = 1e-7  # relative; far inside any resonance of 1e-5 damping, and 1e-9 of rounding
    slope = (transfer(one, s * (1.0 + h)).loop - transfer(one, s * (1.0 - h)).loop) / (2.0 * h)
    with np.errstate(divide="ignore", invalid="ignore"):
        modes = (-sensitivity / slope[..., None]).real
    w = one.plant.tank_frequency
    tanks = slice(0, w.shape[-1])
    modes[..., tanks] = np.where(omega[..., None] < FOLLOWS * w, 0.0, modes[..., tanks])
    return np.concatenate([modes, 1.0 - np.sum(modes, axis=-1, keepdims=True)], axis=-1)


def _padded(
    batch: tuple[int, ...], index: IntArray, omega: Array, value: Array, share: Array, by_value: bool
) -> Points:
    """Sort points into their loops, by value or by frequency, and fill up with nan."""
    order = np.lexsort((value if by_value else omega, index))
    index, omega, value, share = index[order], omega[order], value[order], share[order]
    size = int(np.prod(batch))
    count = np.bincount(index, minlength=size)
    rank = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
    K = max(int(count.max(initial=0)), 1)
    out_omega, out_value = np.full((size, K), np.nan), np.full((size, K), np.nan)
    out_share = np.full((size, K, share.shape[-1]), np.nan)
    out_omega[index, rank], out_value[index, rank], out_share[index, rank] = omega, value, share
    return Points(
        omega=out_omega.reshape(*batch, K),
        value=out_value.reshape(*batch, K),
        share=out_share.reshape(*batch, K, share.shape[-1]),
    )
