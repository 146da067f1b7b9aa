"""Second-order equations of motion of vehicle, slosh masses and bending modes, eqs 1-3 corrected and completed.

    Mq q'' + Cq q' + Kq q = b beta + b2 beta'' - sum_j m_j 2 xi_j w_j z_j' e_j ,   q = [Z, phi, z_1.., eta_1..]

Row by row, multiplied by M, I and m_j (so that Mq is symmetric), with alpha = phi - Z'/V the angle of attack:

    Z:     M Z'' + sum m_j z_j''                       = R' beta + M k3 phi + N alpha + S beta''
    phi:   I phi'' - sum m_j (l_j z_j'' + k3 z_j)      = -(R' Xcg + a S) beta + (Xcp - Xcg) N alpha
                                                         - (S Xcg + I_e) beta''
    z_j:   m_j (Z'' - l_j phi'' + z_j'' + w_j^2 z_j + sum_i (Y_ij eta_i'' - a Y'_ij eta_i))
                                                       = m_j (k3 phi - 2 xi_j w_j z_j')
    eta_i: M_i (eta_i'' + 2 zeta_i W_i eta_i' + W_i^2 eta_i) + sum_j m_j (Y_ij z_j'' - a Y'_ij z_j)
                                                       = (R' Y_i0 - a S Y'_i0) beta + (S Y_i0 - I_e Y'_i0) beta''

The accelerometer at X_a feels the specific force along the body's lateral axis,

    acc = Z'' + (X_a - Xcg) phi'' + sum_i Y_ia eta_i'' - a (phi + sum_i Y'_ia eta_i)

so that a rigid vehicle that drifts under its own thrust (Z'' = a phi) feels nothing at its c.g.

The paper prints the sum of eq 1 with the other sign; the symmetry of Mq and eqs 9, 10 and 21 settle it. The thrust
follows the rigid axis: its turning with the slope of the bent axis at the gimbal is left out.
The slosh damping is not in Cq: it is fed back from z_j' wherever a damping is known (see `response`).
"""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.units import Array, ComplexArray, Real
from sloshpy.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Plant:
    """Matrices of the equations of motion; leading axes are a batch of vehicles.

    mass, damping, stiffness: (..., n, n), SI; the damping is without slosh damping.
    force, inertial_force: (..., n), generalised force per radian of engine angle and per rad/s^2 of its acceleration.
    attitude, rate: (..., n), rows that pick the measured attitude from q and the measured rate from q'.
    accelerometer: (..., 3, n + 1), what it feels: coefficients of s^0, s^1, s^2 on [q, beta]; None where there is none.
    tanks: names; tank j is coordinate `first_tank + j`. tank_mass, tank_frequency: (..., n_tanks).
    modes: names of the bending modes, the last coordinates.
    velocity_only: coordinate 0 is Z and enters by Z' alone (its column of the stiffness is zero).
    guided: the autopilot feeds Z or Z' back, so that drift is a mode of the loop.
    drift_poles: neutral poles at the origin that were removed by structure.
    """

    mass: Array
    damping: Array
    stiffness: Array
    force: Array
    inertial_force: Array
    attitude: Array
    rate: Array
    tanks: tuple[str, ...]
    first_tank: int
    tank_mass: Array
    tank_frequency: Array
    modes: tuple[str, ...] = ()
    velocity_only: bool = False
    guided: bool = False
    drift_poles: int = 0
    accelerometer: Array | None = None

    @property
    def slosh(self) -> slice:
        """Coordinates of the slosh masses."""
        return slice(self.first_tank, self.first_tank + len(self.tanks))

    @property
    def slosh_states(self) -> slice:
        """Where the slosh displacements stand in the state x of `state_space`."""
        gone = 1 if self.velocity_only else 0
        return slice(self.slosh.start - gone, self.slosh.stop - gone)

    def engine_force(self, s: ComplexArray) -> ComplexArray:
        """Return the generalised force per radian of engine angle at s, b + s^2 b2, (..., n)."""
        return np.asarray(self.force + s[..., None] ** 2 * self.inertial_force)

    @property
    def groups(self) -> tuple[str, ...]:
        """What each coordinate belongs to: rigid body, a tank's slosh, a bending mode; guided drift by itself."""
        body = ["drift"] * self.guided + ["rigid body"] * (self.first_tank - self.guided)
        return (*body, *(f"{tank} slosh" for tank in self.tanks), *self.modes)


def plant(vehicle: Vehicle) -> Plant:
    """Assemble the equations of motion of a vehicle, drift included (eqs 1-3, 9-11)."""
    M, I, Xcg, Rp = (np.asarray(x) for x in (vehicle.mass, vehicle.inertia, vehicle.cg, vehicle.vectored_thrust))
    F_axial = np.asarray(vehicle.thrust - np.asarray(vehicle.drag))  # M k3, N
    tanks, modes = vehicle.tanks, vehicle.flexible_modes
    batch = np.broadcast_shapes(*(np.shape(x) for x in _numbers(vehicle)))
    n = 2 + len(tanks) + len(modes)
    Mq, Cq, Kq = (np.zeros((*batch, n, n)) for _ in range(3))
    b, b2, attitude, rate = (np.zeros((*batch, n)) for _ in range(4))
    Mq[..., 0, 0], Mq[..., 1, 1] = M, I
    Kq[..., 0, 1] = -F_axial
    b[..., 0], b[..., 1] = Rp, -Rp * Xcg
    attitude[..., 1] = rate[..., 1] = 1.0
    for j, tank in enumerate(tanks, start=2):
        m, w, l = np.asarray(tank.slosh_mass), np.asarray(tank.frequency), np.asarray(vehicle.lever(tank))
        Mq[..., 0, j] = Mq[..., j, 0] = Mq[..., j, j] = m
        Mq[..., 1, j] = Mq[..., j, 1] = -m * l
        # m k3 as (m/M) (M k3): the same rounding as in `without_drift`, which then cancels it exactly
        Kq[..., 1, j] = Kq[..., j, 1] = -(m / M) * F_axial
        Kq[..., j, j] = m * w**2
        for i, mode in enumerate(modes, start=2 + len(tanks)):
            shape = mode.tank[tank.name]
            Mq[..., i, j] = Mq[..., j, i] = m * shape.deflection
            Kq[..., i, j] = Kq[..., j, i] = -(m / M) * F_axial * shape.slope
    for i, mode in enumerate(modes, start=2 + len(tanks)):
        m, W = np.asarray(mode.generalized_mass), np.asarray(mode.frequency)
        Mq[..., i, i], Cq[..., i, i], Kq[..., i, i] = m, 2.0 * mode.damping * W * m, m * W**2
        b[..., i] = Rp * mode.gimbal.deflection
        attitude[..., i] = mode.gyro.slope
        rate[..., i] = mode.gyro.slope if mode.rate_gyro is None else mode.rate_gyro.slope
    if vehicle.engine is not None:
        S, I_e, a = vehicle.engine.first_moment, vehicle.engine.inertia, F_axial / M
        b2[..., 0], b2[..., 1] = S, -(S * Xcg + I_e)
        b[..., 1] -= a * S
        for i, mode in enumerate(modes, start=2 + len(tanks)):
            b2[..., i] = S * mode.gimbal.deflection - I_e * mode.gimbal.slope
            b[..., i] -= a * S * mode.gimbal.slope
    if vehicle.aerodynamics is not None:
        N, V = vehicle.aerodynamics.normal_force_slope, vehicle.aerodynamics.speed
        arm = np.asarray(vehicle.aerodynamics.center_of_pressure) - Xcg
        Kq[..., 0, 1] -= N
        Kq[..., 1, 1] -= arm * N
        Cq[..., 0, 0] += N / V
        Cq[..., 1, 0] += arm * N / V
    felt = _felt(vehicle, F_axial / M, batch)
    return Plant(
        mass=Mq,
        damping=Cq,
        stiffness=Kq,
        force=b,
        inertial_force=b2,
        attitude=attitude,
        rate=rate,
        tanks=tuple(t.name for t in tanks),
        first_tank=2,
        tank_mass=_stacked([t.slosh_mass for t in tanks], batch),
        tank_frequency=_stacked([t.frequency for t in tanks], batch),
        modes=tuple(mode.name for mode in modes),
        accelerometer=felt,
    )


def _felt(vehicle: Vehicle, a: Array, batch: tuple[int, ...]) -> Array | None:
    """Return the rows of the accelerometer on [Z, phi, z_j, eta_i, beta], None where the vehicle has none."""
    if vehicle.accelerometer_station is None:
        return None
    first = 2 + len(vehicle.tanks)
    rows = np.zeros((*batch, 3, first + len(vehicle.flexible_modes) + 1))
    rows[..., 2, 0] = 1.0
    rows[..., 2, 1] = np.asarray(vehicle.accelerometer_station) - vehicle.cg
    rows[..., 0, 1] = -a
    for i, mode in enumerate(vehicle.flexible_modes, start=first):
        if mode.accelerometer is not None:  # a case that feeds it back has it
            rows[..., 2, i], rows[..., 0, i] = mode.accelerometer.deflection, -a * mode.accelerometer.slope
    return rows


def _numbers(vehicle: Vehicle) -> list[Real]:
    """Return every number of a vehicle whose leading axes make the batch."""
    numbers: list[Real] = [
        vehicle.mass,
        vehicle.inertia,
        vehicle.cg,
        vehicle.thrust,
        vehicle.vectored_thrust,
        vehicle.drag,
    ]
    numbers += [vehicle.accelerometer_station] if vehicle.accelerometer_station is not None else []
    for tank in vehicle.tanks:
        numbers += [tank.slosh_mass, tank.station, tank.frequency]
    for mode in vehicle.flexible_modes:
        numbers += [mode.frequency, mode.damping, mode.generalized_mass, mode.gyro.slope]
        numbers += [
            number for shape in (mode.gimbal, *mode.tank.values()) for number in (shape.deflection, shape.slope)
        ]
        numbers += [mode.rate_gyro.slope] if mode.rate_gyro is not None else []
        numbers += [mode.accelerometer.deflection, mode.accelerometer.slope] if mode.accelerometer is not None else []
    if vehicle.engine is not None:
        numbers += [vehicle.engine.first_moment, vehicle.engine.inertia]
    if vehicle.aerodynamics is not None:
        air = vehicle.aerodynamics
        numbers += [air.normal_force_slope, air.center_of_pressure, air.speed]
    return numbers


def _stacked(values: list[Real], batch: tuple[int, ...]) -> Array:
    if not values:
        return np.zeros((*batch, 0))
    return np.stack([np.broadcast_to(np.asarray(x, dtype=float), batch) for x in values], axis=-1)


def without_drift(full: Plant, position_fed: bool = False, velocity_fed: bool = False) -> Plant:
    """Remove drift from the plant by structure, never by a tolerance on its poles; keep what is fed back, Z or Z'.

    Where nothing depends on Z or Z' (their columns are exactly zero), row Z gives Z'' alone; put into the other rows it
    leaves a plant without the two neutral poles that attitude control neither sees nor moves. Where Z' counts
    (aerodynamics, or guidance by the rate alone) but Z does not, one neutral pole goes.
    """
    if position_fed:
        return replace(full, guided=True)
    if np.any(full.stiffness[..., :, 0]) or np.any(full.attitude[..., 0]) or np.any(full.rate[..., 0]):
        return full
    if velocity_fed or np.any(full.damping[..., :, 0]):
        return replace(full, velocity_only=True, guided=velocity_fed, drift_poles=full.drift_poles + 1)
    share = full.mass[..., 1:, :1] / full.mass[..., :1, :1]

    def eliminate(matrix: Array) -> Array:
        return matrix[..., 1:, 1:] - share * matrix[..., :1, 1:]

    def reduce(vector: Array) -> Array:
        return vector[..., 1:] - share[..., 0] * vector[..., :1]

    felt = full.accelerometer
    return replace(
        full,
        accelerometer=None if felt is None else _without_lateral(felt, full),
        mass=eliminate(full.mass),
        damping=eliminate(full.damping),
        stiffness=eliminate(full.stiffness),
        force=reduce(full.force),
        inertial_force=reduce(full.inertial_force),
        attitude=full.attitude[..., 1:],
        rate=full.rate[..., 1:],
        first_tank=full.first_tank - 1,
        drift_poles=full.drift_poles + 2,
    )


def _without_lateral(felt: Array, full: Plant) -> Array:
    """Return the accelerometer's rows with Z'' put in from its row of the equations of motion."""
    lateral = np.zeros(felt.shape)  # s^2 Z of row Z, on [q, beta]
    for k, matrix in enumerate((full.stiffness, full.damping, full.mass)):
        lateral[..., k, 1:-1] = -matrix[..., 0, 1:]
    lateral[..., 0, -1], lateral[..., 2, -1] = full.force[..., 0], full.inertial_force[..., 0]
    # divided first: -a phi then cancels F/M phi exactly
    return np.asarray((felt + felt[..., 2:, :1] * (lateral / full.mass[..., :1, :1]))[..., 1:])


def slosh_damping(plant: Plant, ratio: Array) -> Array:
    """Return the generalised damping 2 xi_j w_j m_j of each slosh coordinate, kg/s, shape (..., n_tanks)."""
    return np.asarray(2.0 * ratio * plant.tank_frequency * plant.tank_mass)


def state_space(plant: Plant, ratio: Array) -> tuple[Array, Array, Array]:
    """Return A, B, C of x' = A x + B beta (+ B2 beta''), y = [phi, phi'] = C x with x = [q, q'] (eqs 4-12).

    Where Z enters by its velocity alone, the state Z is left out. B2 is `inertial_input`.

    Args:
        plant: equations of motion, with or without drift.
        ratio: slosh damping ratios, shape (..., n_tanks).

    Returns:
        A (..., N, N); B (..., N) and C (..., 2, N) of the plant alone, without the axes of the damping.
    """
    n = plant.mass.shape[-1]
    own, batch = plant.mass.shape[:-2], np.broadcast_shapes(plant.mass.shape[:-2], np.shape(ratio)[:-1])
    # one solve for all dampings of a plant: a damper pushes its slosh mass alone
    pushed = np.broadcast_to(np.eye(n)[:, plant.slosh], (*own, n, len(plant.tanks)))
    right = np.concatenate([-plant.stiffness, -plant.damping, plant.force[..., None], pushed], axis=-1)
    accelerations = np.linalg.solve(plant.mass, right)
    A, B = np.zeros((*batch, 2 * n, 2 * n)), np.zeros((*own, 2 * n))
    A[..., :n, n:] = np.eye(n)
    A[..., n:, :] = accelerations[..., : 2 * n]
    A[..., n:, n:][..., plant.slosh] -= accelerations[..., 2 * n + 1 :] * slosh_damping(plant, ratio)[..., None, :]
    B[..., n:] = accelerations[..., 2 * n]
    C = np.zeros((*plant.attitude.shape[:-1], 2, 2 * n))
    C[..., 0, :n], C[..., 1, n:] = plant.attitude, plant.rate
    first = 1 if plant.velocity_only else 0
    return A[..., first:, first:], B[..., first:], C[..., first:]


def inertial_input(plant: Plant) -> Array:
    """Return B2, the input of the engine's angular acceleration beta'' to the state of `state_space`, (..., N)."""
    accelerations = np.linalg.solve(plant.mass, plant.inertial_force[..., None])[..., 0]
    return np.concatenate([np.zeros_like(accelerations)[..., int(plant.velocity_only) :], accelerations], axis=-1)
