"""The loop over a range of one tank's slosh damping: responses and margins (figs 5-7), disc margin as a curve."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case, Criteria
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.response import FrequencyResponse, frequency_response, transfer
from sloshpy.stability.joint_damping import joint_damping, joint_required_damping
from sloshpy.stability.margins import Margins, loop_margins
from sloshpy.stability.nichols import nichols_disc_margin, sampled
from sloshpy.stability.required_damping import RequiredDamping
from sloshpy.units import Array, BoolArray

if TYPE_CHECKING:
    import xarray as xr

USUAL = (0.005, 0.01, 0.02, 0.05)  # bare wall to good baffle: where the loop itself singles out no damping
SMOOTH = 0.06  # of the disc margin's axes, and half as much of the distance: longer pieces show as polygons
NEAR = 10.0  # disc margin within which the curves are smoothed


@dataclass(frozen=True, kw_only=True)
class DampingSweep:
    """One loop at several damping ratios of one tank, the other tanks where all meet the disc margin together.

    damping: (D,), ratios of the swept tank, increasing. response: L and z/beta, (D, F), on common frequencies.
    margins: a batch (D,). required: the tank's neutral and required damping.
    """

    case: Case
    tank: int
    damping: Array
    response: FrequencyResponse
    margins: Margins
    required: RequiredDamping

    @property
    def growth(self) -> Array:
        """Greatest growth rate of the closed loop at each damping, 1/s, (D,)."""
        return self.margins.growth

    @property
    def disc_margin(self) -> Array:
        """Signed disc margin of the tank, and of those that share its minimum, (D,); inf where there is no minimum."""
        return self.margins.slosh_disc_margin(*self.required.counted)[0]

    @property
    def tvc_gain(self) -> Array:
        """|z/beta| of the swept tank, m/rad, (D, F), fig 7."""
        return np.asarray(np.abs(self.response.slosh[..., self.tank]))

    @property
    def phase_deg(self) -> Array:
        """Phase of L in degrees, (D, F): continuous, all curves on one branch at the lowest frequency.

        The branch brings the most damped curve's least disc margin of the tank nearest to -180 deg.
        """
        phase = np.degrees(np.unwrap(np.angle(self.response.loop), axis=-1))
        phase -= 360.0 * np.round((phase[:, :1] - phase[-1, 0]) / 360.0)
        near = self.margins.slosh_disc_margin(*self.required.counted)[1][-1]
        k = int(np.argmin(np.abs(self.response.omega - near))) if np.isfinite(near) else 0
        return np.asarray(phase - 360.0 * np.round((phase[-1, k] + 180.0) / 360.0))

    @property
    def lobe(self) -> BoolArray:
        """Which frequencies belong to the tank's slosh lobe, (F,): within a third of an octave, nearest to its tank."""
        octaves = [np.abs(np.log2(self.response.omega / float(t.frequency))) for t in self.case.vehicle.tanks]
        own = octaves[self.tank]
        return np.asarray((own < 1.0 / 3.0) & (own <= np.min(octaves, axis=0)))

    @property
    def neighbourhood(self) -> BoolArray:
        """Which frequencies lie within two thirds of an octave about the tank's, (F,)."""
        own = float(self.case.vehicle.tanks[self.tank].frequency)
        return np.asarray(np.abs(np.log2(self.response.omega / own)) < 2.0 / 3.0)

    @property
    def window(self) -> tuple[float, float]:
        """Frequencies worth showing, rad/s: two octaves about all slosh and gain crossings."""
        crossings = self.margins.gain_crossings.omega
        marks = [float(t.frequency) for t in self.case.vehicle.tanks] + [*crossings[np.isfinite(crossings)]]
        return 0.25 * min(marks), 4.0 * max(marks)

    @property
    def peak(self) -> Array:
        """Greatest |z/beta| about the tank's frequency at each damping, m/rad, and where, rad/s, (2, D)."""
        k = np.argmax(np.where(self.neighbourhood, self.tvc_gain, 0.0), axis=-1)
        return np.array([np.take_along_axis(self.tvc_gain, k[:, None], axis=-1)[:, 0], self.response.omega[k]])

    @property
    def verdicts(self) -> tuple[str, ...]:
        """What each damping amounts to: "unstable", "neutral", "not robust" or "robust"."""
        enough = self.damping >= self.required.required  # False where none suffices
        robust = np.where(enough, "robust", "not robust")
        unstable = np.where(self.margins.neutral, "neutral", "unstable")
        return tuple(str(word) for word in np.where(self.margins.stable & ~self.margins.neutral, robust, unstable))

    def __str__(self) -> str:
        lines = [str(self.required)]
        for xi, margin, growth, word in zip(self.damping, self.disc_margin, self.growth, self.verdicts, strict=True):
            near = f"slosh disc margin {margin:+8.4f}" if np.isfinite(margin) else "no minimum of its own    "
            lines.append(f"  {100.0 * xi:7.3f} %  {near}  growth {growth:+.5f} 1/s  {word}")
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return responses and margins as an xarray Dataset over damping and frequency."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "gain_db": (["damping", "omega"], self.response.gain_db, {"units": "dB"}),
                "phase_deg": (["damping", "omega"], self.response.phase_deg, {"units": "deg"}),
                "tvc_gain": (["damping", "omega"], self.tvc_gain, {"units": "m/rad"}),
                "disc_margin": ("damping", self.disc_margin, {"units": "1"}),
                "growth": ("damping", self.growth, {"units": "1/s"}),
            },
            coords={
                "damping": ("damping", self.damping, {"units": "1"}),
                "omega": ("omega", self.response.omega, {"units": "rad/s"}),
            },
            attrs={"tank": self.required.tank, "required_damping": float(self.required.required)},
        )


@dataclass(frozen=True, kw_only=True)
class DiscMarginCurve:
    """A tank's own signed disc margin over its damping ratio.

    damping: (D,), ratios, increasing. disc_margin: (D,), negative where the loop is unstable, inf where no minimum of
    eq 24 belongs to the tank. growth: (D,), 1/s.
    """

    case: Case
    damping: Array
    disc_margin: Array
    growth: Array
    required: RequiredDamping

    def __str__(self) -> str:
        low, high = 100.0 * self.damping[[0, -1]]
        return f"{self.required}\n  disc margin on {len(self.damping)} dampings from {low:.3g} % to {high:.3g} %"

    def to_dataset(self) -> "xr.Dataset":
        """Return the curve as an xarray Dataset over the damping."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "disc_margin": ("damping", self.disc_margin, {"units": "1"}),
                "growth": ("damping", self.growth, {"units": "1/s"}),
            },
            coords={"damping": ("damping", self.damping, {"units": "1"})},
            attrs={"tank": self.required.tank, "required_damping": float(self.required.required)},
        )


def damping_sweep(
    case: Case,
    damping: Array | tuple[float, ...] | None = None,
    tank: int | str = 0,
    required: RequiredDamping | None = None,
) -> DampingSweep:
    """Return responses and margins of a case at several dampings of one tank.

    Args:
        case: one vehicle and autopilot, no batch.
        damping: ratios > 0; default: `telling_dampings`.
        tank: name or number of the tank that is swept.
        required: the tank's requirement, where it is known already.
    """
    single(case, "damping_sweep")
    tank = case.tank_index(tank)
    needed = _needed(case, tank) if required is None else required
    xi = np.unique(telling_dampings(needed) if damping is None else damping)
    if not np.all(xi > 0.0):
        raise ValueError("a swept damping must be > 0: the response of an undamped slosh mass is infinite")
    loop = _swept(case, tank, xi, needed)
    return DampingSweep(
        case=case,
        tank=tank,
        damping=xi,
        response=frequency_response(loop, _frequencies(loop, case.criteria)),
        margins=loop_margins(loop, case.criteria),
        required=needed,
    )


def telling_dampings(required: RequiredDamping) -> tuple[float, ...]:
    """Return dampings that show the verdicts: half the neutral, between it and the required, required, twice that."""
    neutral, enough = float(required.neutral), float(required.required)
    if not enough > 0.0:
        return USUAL
    if neutral == 0.0:
        return 0.5 * enough, enough, 2.0 * enough
    return 0.5 * neutral, 0.5 * (neutral + enough), enough, 2.0 * enough


def disc_margin_curve(
    case: Case, damping: Array | None = None, tank: int | str = 0, required: RequiredDamping | None = None
) -> DiscMarginCurve:
    """Return a tank's signed disc margin over its damping, the other tanks where all meet the disc margin together.

    Args:
        case: one vehicle and autopilot, no batch.
        damping: ratios; default: 81 up to twice the required damping, neutral and required among them.
        tank: name or number of the tank.
        required: the tank's requirement, where it is known already.
    """
    single(case, "disc_margin_curve")
    tank = case.tank_index(tank)
    needed = _needed(case, tank) if required is None else required
    if damping is None:
        marks = np.array([needed.neutral, needed.required], dtype=float)
        marks = marks[np.isfinite(marks)]
        most = 2.0 * np.max(marks, initial=0.0) or 2.0 * USUAL[-1]
        damping = np.unique(np.concatenate([np.linspace(0.0, most, 81), marks]))
    found = loop_margins(_swept(case, tank, np.asarray(damping, dtype=float), needed), case.criteria, crossings=False)
    return DiscMarginCurve(
        case=case,
        damping=np.asarray(damping, dtype=float),
        disc_margin=found.slosh_disc_margin(*needed.counted)[0],
        growth=found.growth,
        required=needed,
    )


def _needed(case: Case, tank: int) -> RequiredDamping:
    return joint_required_damping(open_loop(case, joint_damping(case)), case.criteria, tank, case.criteria.disc_margin)


def _swept(case: Case, tank: int, ratio: Array, needed: RequiredDamping) -> Loop:
    """Return a batch of loops, one for each damping of one tank."""
    own = needed.source.damping  # where the requirement held the other tanks
    return open_loop(case, damping=np.where(np.arange(len(own)) == tank, ratio[:, None], own))


def _frequencies(loop: Loop, criteria: Criteria) -> Array:
    """Return frequencies common to a batch on which every curve is drawn without corners, rad/s.

    Those of `sampled` for every loop, a smooth background, and halvings where a curve near the critical point turns.
    """
    found = sampled(loop, criteria.gain_margin, criteria.phase_margin).omega
    omega = np.unique(np.concatenate([found, np.geomspace(np.min(found), np.max(found), 400)]))
    for _ in range(8):
        L = transfer(loop.along(), 1j * omega).loop
        step = np.log(L[..., 1:] / L[..., :-1])
        chord = np.hypot(step.real / np.log(criteria.gain_margin), step.imag / criteria.phase_margin)
        distance = nichols_disc_margin(L, criteria.gain_margin, criteria.phase_margin)
        near = np.minimum(distance[..., 1:], distance[..., :-1]) < NEAR
        long = near & (chord > SMOOTH * (1.0 + 0.5 * np.minimum(distance[..., 1:], distance[..., :-1])))
        wide = np.flatnonzero(np.any(long, axis=0) & (omega[1:] > omega[:-1] * (1.0 + 1e-6)))
        if len(wide) == 0:
            break
        omega = np.insert(omega, wide + 1, np.sqrt(omega[wide] * omega[wide + 1]))
    return omega
