"""Second-order equations of motion of vehicle and slosh masses, eqs 1-3 corrected.

    Mq q'' + Cq q' + Kq q = b beta - sum_j m_j 2 xi_j w_j z_j' e_j ,   q = [Z, phi, z_1, ..., z_n]

Row by row, multiplied by M, I and m_j (so that Mq is symmetric):

    Z:    M Z'' + sum m_j z_j''                       = R' beta + M k3 phi
    phi:  I phi'' - sum m_j (l_j z_j'' + k3 z_j)      = -R' Xcg beta
    z_j:  m_j (Z'' - l_j phi'' + z_j'' + w_j^2 z_j)   = m_j k3 phi - m_j 2 xi_j w_j z_j'

The paper prints the sum of eq 1 with the other sign; the symmetry of Mq and eqs 9, 10 and 21 settle it.
The slosh damping is not in Cq: it is fed back from z_j' wherever a damping is known (see `response`).
"""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.units import Array
from sloshpy.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Plant:
    """Matrices of the equations of motion; leading axes are a batch of vehicles.

    mass, damping, stiffness: (..., n, n), SI; the damping is without slosh damping.
    force: (..., n), generalised force per radian of engine angle.
    attitude: (n,), row that picks the measured attitude from q (its rate from q').
    tanks: names; tank j is coordinate `first_tank + j`. tank_mass, tank_frequency: (..., n_tanks).
    drift_poles: neutral poles at the origin that were removed by structure.
    """

    mass: Array
    damping: Array
    stiffness: Array
    force: Array
    attitude: Array
    tanks: tuple[str, ...]
    first_tank: int
    tank_mass: Array
    tank_frequency: Array
    drift_poles: int = 0

    @property
    def slosh(self) -> slice:
        """Coordinates of the slosh masses."""
        return slice(self.first_tank, self.first_tank + len(self.tanks))


def plant(vehicle: Vehicle) -> Plant:
    """Assemble the equations of motion of a vehicle, drift included (eqs 1-3, 9-11)."""
    M, I, Xcg, Rp = (np.asarray(x) for x in (vehicle.mass, vehicle.inertia, vehicle.cg, vehicle.vectored_thrust))
    F_axial = np.asarray(vehicle.thrust - np.asarray(vehicle.drag))  # M k3, N
    m = [np.asarray(t.slosh_mass) for t in vehicle.tanks]
    w = [np.asarray(t.frequency) for t in vehicle.tanks]
    l = [np.asarray(vehicle.lever(t)) for t in vehicle.tanks]
    batch = np.broadcast_shapes(*(x.shape for x in (M, I, Xcg, Rp, F_axial, *m, *w, *l)))
    n = 2 + len(m)
    Mq, Kq, b = np.zeros((*batch, n, n)), np.zeros((*batch, n, n)), np.zeros((*batch, n))
    Mq[..., 0, 0], Mq[..., 1, 1] = M, I
    Kq[..., 0, 1] = -F_axial
    b[..., 0], b[..., 1] = Rp, -Rp * Xcg
    for j, (m_j, w_j, l_j) in enumerate(zip(m, w, l, strict=True), start=2):
        Mq[..., 0, j] = Mq[..., j, 0] = Mq[..., j, j] = m_j
        Mq[..., 1, j] = Mq[..., j, 1] = -m_j * l_j
        # m_j k3 as (m_j/M) (M k3): the same rounding as in `without_drift`, which then cancels it exactly
        Kq[..., 1, j] = Kq[..., j, 1] = -(m_j / M) * F_axial
        Kq[..., j, j] = m_j * w_j**2
    stack = [np.broadcast_to(x, batch) for x in m], [np.broadcast_to(x, batch) for x in w]
    return Plant(
        mass=Mq,
        damping=np.zeros((*batch, n, n)),
        stiffness=Kq,
        force=b,
        attitude=np.eye(n)[1],
        tanks=tuple(t.name for t in vehicle.tanks),
        first_tank=2,
        tank_mass=np.stack(stack[0], axis=-1) if m else np.zeros((*batch, 0)),
        tank_frequency=np.stack(stack[1], axis=-1) if w else np.zeros((*batch, 0)),
    )


def without_drift(full: Plant) -> Plant:
    """Remove Z from the plant where nothing depends on Z or Z' (no tolerance: their columns are exactly zero).

    Row Z then gives Z'' alone; put into the other rows it leaves a plant without the two neutral poles that attitude
    control neither sees nor moves.
    """
    if np.any(full.stiffness[..., :, 0]) or np.any(full.damping[..., :, 0]) or full.attitude[0] != 0.0:
        return full
    share = full.mass[..., 1:, :1] / full.mass[..., :1, :1]

    def eliminate(matrix: Array) -> Array:
        return matrix[..., 1:, 1:] - share * matrix[..., :1, 1:]

    return replace(
        full,
        mass=eliminate(full.mass),
        damping=eliminate(full.damping),
        stiffness=eliminate(full.stiffness),
        force=full.force[..., 1:] - share[..., 0] * full.force[..., :1],
        attitude=full.attitude[1:],
        first_tank=full.first_tank - 1,
        drift_poles=full.drift_poles + 2,
    )


def slosh_damping(plant: Plant, ratio: Array) -> Array:
    """Return the generalised damping 2 xi_j w_j m_j of each slosh coordinate, kg/s, shape (..., n_tanks)."""
    return np.asarray(2.0 * ratio * plant.tank_frequency * plant.tank_mass)


def state_space(plant: Plant, ratio: Array) -> tuple[Array, Array, Array]:
    """Return A, B, C of x' = A x + B beta, y = [phi, phi'] = C x with x = [q, q'] (eqs 4-12).

    Args:
        plant: equations of motion, with or without drift.
        ratio: slosh damping ratios, shape (..., n_tanks).
    """
    n = plant.mass.shape[-1]
    slosh = plant.slosh
    batch = np.broadcast_shapes(plant.mass.shape[:-2], np.shape(ratio)[:-1])
    C_all = np.broadcast_to(plant.damping, (*batch, n, n)).copy()
    diagonal = np.arange(n)[slosh]
    C_all[..., diagonal, diagonal] += slosh_damping(plant, ratio)
    right = np.concatenate(
        [
            -np.broadcast_to(plant.stiffness, (*batch, n, n)),
            -C_all,
            np.broadcast_to(plant.force, (*batch, n))[..., None],
        ],
        axis=-1,
    )
    accelerations = np.linalg.solve(plant.mass, right)
    A = np.zeros((*batch, 2 * n, 2 * n))
    A[..., :n, n:] = np.eye(n)
    A[..., n:, :] = accelerations[..., : 2 * n]
    B = np.zeros((*batch, 2 * n))
    B[..., n:] = accelerations[..., 2 * n]
    C = np.zeros((2, 2 * n))
    C[0, :n] = C[1, n:] = plant.attitude
    return A, B, C
