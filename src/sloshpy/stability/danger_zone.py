"""Where along the vehicle a slosh mass destabilises the loop: closed form (eqs 21-23) and any autopilot."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.autopilot import Autopilot, forward_transfer
from sloshpy.autopilot.coefficients import each
from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics.characteristic import characteristic_matrix
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.plant import state_space
from sloshpy.dynamics.sensed import bordering_row
from sloshpy.errors import OutsideValidity
from sloshpy.stability.damping_search import MOST_RATIO
from sloshpy.stability.joint_damping import joint_damping, joint_required_damping
from sloshpy.units import Array, IntArray, Real
from sloshpy.vehicle import Vehicle

if TYPE_CHECKING:
    import xarray as xr

LEAST_LEAD = np.radians(10.0)  # below this lead the zone shrinks to nothing and then inverts
MAP_LEVELS = 23  # damping values scanned at each station, in steps of 1.4
JUMP = 0.05  # of the greatest required damping: between neighbours that differ by more,
ABRUPT = 2.0  # and by so much more than the next ones do, stations are added,
HALVINGS = 3  # so often


@dataclass(frozen=True, kw_only=True)
class DangerZone:
    """Closed-form danger zone of one tank; distances l = Xcg - X in m, positive behind the c.g.

    Numbers for one vehicle, arrays of the batch's shape for a batch, whose answer is `within`.
    aft: a (1 - m/M) / w^2 (eq 23). forward: -I/(M Xcg), the centre of percussion (eq 22).
    Greensite's zone has the c.g. for its rear bound.
    lead: phase lead of the PD gains less the lag of filters, delay and actuator at the slosh frequency, rad; nan where
    an accelerometer is fed back, which the closed form does not know.
    reason: why the closed form gives no answer here ("" where it does). note: what limits it otherwise.
    """

    case: Case
    tank: str
    l: Real
    aft: Real
    forward: Real
    lead: Real
    reason: str
    note: str

    @property
    def inside(self) -> bool | None:
        """Whether the slosh mass of one vehicle lies in the zone; None where the closed form is refused."""
        return None if np.isnan(self.within) else bool(self.within)

    @property
    def within(self) -> Array:
        """1 where the slosh mass lies in the zone, 0 where not, nan where the closed form is refused."""
        inside = (self.forward < np.asarray(self.l)) & (self.l < np.asarray(self.aft))
        return np.asarray(np.where(np.asarray(self.lead) > LEAST_LEAD, inside.astype(float), np.nan))

    def to_dataset(self) -> "xr.Dataset":
        """Return the zone as an xarray Dataset with units in the attributes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        axes = [f"batch_{i}" for i in range(np.ndim(self.l))]
        return xr.Dataset(
            {
                "l": (axes, self.l, {"units": "m"}),
                "aft": (axes, self.aft, {"units": "m"}),
                "forward": (axes, self.forward, {"units": "m"}),
                "lead": (axes, self.lead, {"units": "rad"}),
            },
            attrs={"tank": self.tank, "reason": self.reason, "note": self.note},
        )

    def __str__(self) -> str:
        if np.ndim(self.l):
            within, refused = int(np.nansum(self.within)), int(np.sum(np.isnan(self.within)))
            return f"{self.tank}: {within} of {np.size(self.l)} vehicles inside the danger zone, {refused} refused"
        place = {True: "INSIDE", False: "outside", None: "closed form refused:"}[self.inside]
        zone = f"from {self.aft:.4f} m behind to {-self.forward:.4f} m ahead of the c.g."
        tail = f" {self.reason}" if self.reason else f" the danger zone {zone}"
        note = f"\n  {self.note}" if self.note else ""
        if np.isnan(self.lead):
            return f"{self.tank}: l = {self.l:.4g} m, {place}{tail}{note}"
        return (
            f"{self.tank}: l = {self.l:.4g} m, {place}{tail}\n"
            f"  Greensite: from the c.g. to {-self.forward:.4f} m ahead; "
            f"lead less lag at the slosh frequency {np.degrees(self.lead):.1f} deg{note}"
        )


def danger_zone(case: Case, tank: int | str = 0) -> DangerZone:
    """Return the closed-form danger zone of a tank (eqs 21-23, for any k3 and k4).

    Pole and zero of phi/beta coincide at both bounds; between them PD control destabilises the slosh mode. Derived for
    one tank under PD control: with more lag than lead at the slosh frequency it is refused.
    """
    tank = case.tank_index(tank)
    v = case.vehicle
    mass = v.tanks[tank]
    M, I, Xcg, m, w = (np.asarray(x) for x in (v.mass, v.inertia, v.cg, mass.slosh_mass, mass.frequency))
    aft, forward = np.asarray(v.acceleration) * (1.0 - m / M) / w**2, -I / (M * Xcg)  # eqs 23 and 22
    lead = np.where(np.asarray(case.autopilot.accelerometer_gain) == 0.0, phase_lead(case.autopilot, w), np.nan)
    l, aft, forward, lead = np.broadcast_arrays(v.lever(mass), aft, forward, lead)
    numbers: list[Real] = [x if x.ndim else float(x) for x in (l, aft, forward, lead)]
    reason = note = ""
    if l.ndim == 0 and np.isnan(lead):
        reason = "an accelerometer is fed back, which moves the zeros; read the required damping along the vehicle"
    elif l.ndim == 0 and lead <= LEAST_LEAD:
        reason = (
            f"lag eats the PD lead at the slosh frequency (lead less lag {np.degrees(lead):.1f} deg, needs more than "
            "10 deg); read the required damping along the vehicle"
        )
    elif len(v.tanks) > 1:
        note = "several tanks: the closed form is a guideline; read the required damping along the vehicle"
    elif _beyond_pd(case.autopilot):
        note = "derived for PD control alone; the map of required damping takes the whole autopilot"
    return DangerZone(
        case=case,
        tank=mass.name,
        l=numbers[0],
        aft=numbers[1],
        forward=numbers[2],
        lead=numbers[3],
        reason=reason,
        note=note,
    )


def _beyond_pd(a: Autopilot) -> bool:
    """Return whether a loop holds more than the PD control of the closed form."""
    beyond = a.filter or a.actuator or a.sample_time
    return bool(beyond or any(np.any(x) for x in (a.delay, a.drift_gain, a.drift_rate_gain)))


def phase_lead(autopilot: Autopilot, omega: Real) -> Array:
    """Return the lead of the PD gains less the lag of filters, delay and actuator at frequencies in rad/s, rad."""
    omega = np.asarray(omega, dtype=float)
    a0, a1 = np.asarray(autopilot.attitude_gain), np.asarray(autopilot.rate_gain)
    parts = [f.fraction for f in autopilot.filter]
    parts += [autopilot.actuator.fraction] if autopilot.actuator is not None else []
    lag = sum(
        (_phase(bottom, omega) - _phase(top, omega) for top, bottom in parts), np.asarray(autopilot.dead_time) * omega
    )
    for f in autopilot.digital_filter:
        turn = omega * (autopilot.sample_time or 0.0)
        lag = lag + _pulse_phase(f.denominator, turn) - _pulse_phase(f.numerator, turn)
    return np.asarray(np.arctan2(a1 * omega, a0) - lag)


def _phase(polynomial: Array, omega: Array) -> Array:
    """Return the phase of polynomials (k, ...) at j omega, continuous from omega = 0 on: each root by itself."""
    if polynomial.ndim > 1:
        shape = np.broadcast_shapes(polynomial.shape[1:], omega.shape)
        own = np.stack([np.broadcast_to(c, shape) for c in polynomial])
        at = np.broadcast_to(omega, shape).ravel()
        found = [_phase(c, np.asarray(w)) for c, w in zip(each(own), at, strict=True)]
        return np.array(found).reshape(shape)
    roots = np.roots(polynomial)
    still = np.prod(-roots[roots != 0.0]) * polynomial[0]  # what is left at omega = 0, real
    turned = [np.angle(1.0 - 1j * omega / r) if r != 0.0 else np.full(omega.shape, np.pi / 2.0) for r in roots]
    return np.asarray(sum(turned, np.full(omega.shape, np.angle(still.real))))


def _pulse_phase(polynomial: tuple[float, ...], angle: Array) -> Array:
    """Return the phase of a polynomial in z at z = e^{j angle}, continuous from angle 0 to pi: each root by itself."""
    roots = np.roots(polynomial)
    z = np.exp(1j * angle)
    still = np.prod(1.0 - roots[roots != 1.0]) * polynomial[0]  # what is left at z = 1, real
    total = np.full(z.shape, np.angle(still.real))
    for r in roots:
        if abs(r) <= 1.0:  # z - r = z (1 - r/z), whose second factor stays in the right half-plane
            total += angle + np.angle(1.0 - r / z) - (0.0 if r == 1.0 else np.angle(1.0 - r))
        else:
            total += np.angle(1.0 - z / r) - np.angle(1.0 - 1.0 / r)
    return np.asarray(total)


@dataclass(frozen=True, kw_only=True)
class RequiredDampingMap:
    """Damping that one tank needs at each station: what a case that is edited to have it stand there needs.

    station: (S,), m forward of the gimbal. required, neutral: (S,), damping ratios; nan where none suffices.
    departure: (S,), 1/s: real part of the undamped slosh pole's first-order departure per unit of loop gain;
    positive where the loop destabilises it. zone: the closed form beside it.
    """

    case: Case
    tank: str
    station: Array
    required: Array
    neutral: Array
    departure: Array
    zone: DangerZone

    def __str__(self) -> str:
        worst = int(np.nanargmax(np.where(np.isnan(self.required), np.inf, self.required)))
        need = self.required[worst]
        text = "no damping suffices" if np.isnan(need) else f"{100.0 * need:.3f} % needed"
        if need > (1.0 - 1e-5) * MOST_RATIO:
            text = f"{100.0 * MOST_RATIO:g} % needed, the most that is sought"
        return f"{self.zone}\n  worst of {len(self.station)} stations, {self.station[worst]:.3f} m: {text}"

    def to_dataset(self) -> "xr.Dataset":
        """Return the map as an xarray Dataset over the station."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "required": ("station", self.required, {"units": "1"}),
                "neutral": ("station", self.neutral, {"units": "1"}),
                "departure": ("station", self.departure, {"units": "1/s"}),
            },
            coords={"station": ("station", self.station, {"units": "m"})},
            attrs={"tank": self.tank},
        )


def required_damping_map(case: Case, tank: int | str = 0, station: Array | None = None) -> RequiredDampingMap:
    """Return the required damping and the departure of a tank's slosh mode as its station moves, any autopilot.

    At each station the other tanks are held anew where all meet the disc margin together, see `joint_damping`, and
    what coupled tanks ask of it counts, see `joint_required_damping`: where a new station leaves another tank short,
    the curve may rise steeply to the damping that would make up for it.

    Args:
        case: one vehicle and autopilot, no batch.
        tank: name or number of the tank to move.
        station: stations in m forward of the gimbal; default: 41, or 21 for a large vehicle, across the closed-form
            zone and the tank's own and beyond, with the bounds of the zone, the tank's own station, and more where the
            curve jumps.
    """
    single(case, "required_damping_map")
    tank = case.tank_index(tank)
    zone = danger_zone(case, tank)
    at = np.asarray(_stations(case.vehicle, tank, zone) if station is None else station, dtype=float)
    found = _needs(case, tank, at)
    for _ in range(HALVINGS if station is None else 0):
        k = _jumps(found[0])
        if len(k) == 0:
            break
        between = 0.5 * (at[k] + at[k + 1])
        at, found = np.insert(at, k + 1, between), np.insert(found, k + 1, _needs(case, tank, between), axis=1)
    return RequiredDampingMap(
        case=case,
        tank=case.vehicle.tanks[tank].name,
        station=at,
        required=found[0],
        neutral=found[1],
        departure=found[2],
        zone=zone,
    )


def _needs(case: Case, tank: int, station: Array) -> Array:
    """Return required damping, neutral damping and departure of a tank at stations, (3, S)."""
    v = case.vehicle
    there = {"station": station, "hinge_station": None, "pendulum_length": None}  # a pendulum moves as a whole
    tanks = [t.model_copy(update=there) if j == tank else t for j, t in enumerate(v.tanks)]
    moved = case.model_copy(update={"vehicle": v.model_copy(update={"tanks": tuple(tanks)})})
    if np.any(moved.vehicle.mass_matrix_margin <= 0.0):
        raise OutsideValidity(
            "a station is so far from the c.g. that the mass matrix is indefinite; give nearer stations"
        )
    loop = open_loop(moved, joint_damping(moved, MAP_LEVELS))
    needed = joint_required_damping(loop, case.criteria, tank, case.criteria.disc_margin, levels=MAP_LEVELS)
    return np.array([needed.required, needed.neutral, departure(loop, tank)])


def _jumps(required: Array) -> IntArray:
    """Return after which stations the curve jumps, or ends."""
    known = np.where(np.isnan(required), np.inf, required)
    most = np.max(required, initial=0.0, where=np.isfinite(required))
    with np.errstate(invalid="ignore"):  # between two that have no number
        rise = np.nan_to_num(np.abs(np.diff(known)), posinf=np.inf)
    beside = np.concatenate([[0.0], rise, [0.0]])
    return np.flatnonzero((rise > JUMP * most) & (rise > ABRUPT * np.maximum(beside[:-2], beside[2:])))


def _stations(v: Vehicle, tank: int, zone: DangerZone) -> Array:
    """Return stations across the zone and the tank's own, a tenth beyond, as far as the mass matrix allows."""
    moved, cg = v.tanks[tank], float(v.cg)
    m = float(moved.slosh_mass)
    reach = np.sqrt(0.9 * (1.0 - m / float(v.mass)) * float(v.inertia) / m)
    marks = np.append(cg - np.array([zone.aft, zone.forward], dtype=float), float(moved.station))
    beyond = 0.1 * float(np.ptp(marks))
    # a tank that stands farther out than the reach stays in the picture: its own station is possible
    low, high = (
        min(max(marks.min() - beyond, cg - reach), marks[2]),
        max(min(marks.max() + beyond, cg + reach), marks[2]),
    )
    count = 41 if len(v.tanks) + len(v.flexible_modes) < 3 else 21  # a large vehicle costs more at each
    return np.unique(np.concatenate([np.linspace(low, high, count), marks[(marks >= low) & (marks <= high)]]))


def departure(loop: Loop, tank: int) -> Array:
    """Return the real part of ds/dk at k = 0 for the undamped slosh pole of a tank, 1/s, k an extra loop gain.

    s = p + k K(p) r with r the residue of what the autopilot is fed over beta at the pole p of the plant:
    r = (row(p) . v)(u . b(p)) / (u . D'(p) v), where D(p) v = 0 and u D(p) = 0. The delay in K is exact.
    """
    p = loop.plant
    j = p.first_tank + tank
    bare = replace(loop, damping=np.where(np.arange(len(p.tanks)) == tank, 0.0, loop.damping))
    poles = np.linalg.eigvals(state_space(bare.plant, bare.damping)[0])
    greatest, rate = np.full(poles.shape[:-1], -np.inf), np.full(poles.shape[:-1], np.nan)
    for k in range(poles.shape[-1]):
        s = poles[..., k].astype(complex)
        T, dT = characteristic_matrix(bare, s, closed=False)
        D, dD = T[..., :-1, :-1], dT[..., :-1, :-1]
        left, _, right = np.linalg.svd(D)
        u, v = np.conj(left[..., :, -1]), np.conj(right[..., -1, :])
        with np.errstate(divide="ignore", invalid="ignore"):  # the rigid body's double pole at the origin
            weight = np.einsum("...i,...ij,...j->...", u, dD, v)
            share = np.abs(u[..., j] * dD[..., j, j] * v[..., j] / weight)
            seen = np.sum(bordering_row(loop, s)[0][..., :-1] * v, axis=-1)
            moved = forward_transfer(loop.autopilot, s) * seen * np.sum(u * p.engine_force(s), axis=-1) / weight
        better = (s.imag > 0.0) & (share > greatest)  # the pole in which this tank takes part most
        greatest = np.where(better, share, greatest)
        rate = np.where(better, moved.real, rate)
    return rate
