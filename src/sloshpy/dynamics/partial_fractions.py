"""The reduction of `response.unfed` for many plants on many frequencies, by the modes of each.

A partial fraction over the plant's eigenvalues costs a matrix product where `unfed` solves at every frequency.
Eigenvectors may be ill-conditioned (two equal tanks), so that it is held against `unfed` where it is worst.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import unfed
from sloshpy.dynamics.sensed import fed
from sloshpy.units import Array, BoolArray, ComplexArray

AGREEMENT = 1e-10  # of the greatest value of each function on the frequencies where it is checked, in its own unit

Parts = tuple[ComplexArray, ...]


def references_on(loops: Loop, omega: Array, ratio: Array) -> list[Callable[[Array], Parts]]:
    """Return a function of frequencies for each loop: y_b, Y_a, z_b and Z_a of `unfed`, frequencies last.

    By modes, or where these do not give on `omega` what a solve does, by solves.

    Args:
        loops: a batch of one axis; its damping plays no part.
        omega: the frequencies that will be asked for, rising, (F,), rad/s.
        ratio: damping ratios of the tanks, (n_tanks,), the same for all.
    """
    count = loops.batch[0]
    if loops.plant.mass.shape[-1] == 2:  # in closed form, which is faster still
        return [_solves(loops, k, ratio) for k in range(count)]
    with np.errstate(all="ignore"):  # vectors that are no basis give anything, which is compared
        try:
            modes = _plant_modes(loops, ratio)
        except np.linalg.LinAlgError:
            return [_solves(loops, k, ratio) for k in range(count)]
        places = [np.clip(np.searchsorted(omega, np.abs(one.poles)), 0, len(omega) - 1) for one in modes]
        width = max(map(len, places))
        check = omega[np.array([np.resize(place, width) for place in places])]  # rounding shows most beside a pole
        true = [np.moveaxis(x, 1, -1) for x in unfed(loops.along(), 1j * check, ratio)]
        sound = [_agree(one.at(check[k]), tuple(x[k] for x in true)) for k, one in enumerate(modes)]
    return [
        one.at if fine else _solves(loops, k, ratio) for k, (one, fine) in enumerate(zip(modes, sound, strict=True))
    ]


def _agree(found: Parts, true: Parts) -> bool:
    return all(
        np.all(np.abs(a - b) <= AGREEMENT * np.max(np.abs(b), axis=-1, keepdims=True))
        for a, b in zip(found, true, strict=True)
    )


def _solves(loops: Loop, k: int, ratio: Array) -> Callable[[Array], Parts]:
    """Return the same for loop k by a solve at each frequency."""
    loop = loops.take(np.asarray(k))

    def at(omega: Array) -> Parts:
        return tuple(np.asarray(np.moveaxis(x, 0, -1), dtype=complex) for x in unfed(loop, 1j * omega, ratio))

    return at


@dataclass(frozen=True, kw_only=True)
class _Modes:
    """Partial fractions of a plant: of y, phi'' and each z_j to beta, beta'' and the acceleration of each slosh mass.

    poles: in the upper half-plane, then on the real axis (`real`). weights: (outputs * inputs, N), of the functions
    that `at` builds from the poles. at_once: of y and phi'' to each input, (2, inputs). attitude: what y is of phi and
    phi' beyond the states that have modes, (2,). inertial: whether beta'' acts at all.
    """

    poles: ComplexArray
    real: BoolArray
    weights: Array
    at_once: Array
    attitude: Array
    inertial: bool

    def at(self, omega: Array) -> Parts:
        """Return y_b, Y_a, z_b and Z_a at frequencies (F,), which come last."""
        s, p = 1j * omega, self.poles[~self.real, None]
        with np.errstate(divide="ignore", invalid="ignore"):  # on an undamped pole: no number, and a solve decides
            pair = 1.0 / (np.abs(p) ** 2 - omega**2 - 2j * p.real * omega)
            functions = np.concatenate([pair, s * pair, 1.0 / (s - self.poles[self.real, None].real)])
        inputs = self.at_once.shape[1]
        G = (self.weights @ functions.view(float)).view(complex).reshape(inputs, inputs, -1)
        G[:2] += self.at_once[..., None]
        if np.any(self.attitude):
            G[0] += (self.attitude[0] + s * self.attitude[1]) / s**2 * G[1]
        by_beta = G[:, 0] - omega**2 * G[:, 1] if self.inertial else G[:, 0]
        return by_beta[0], G[0, 2:], by_beta[2:], G[2:, 2:]


def _plant_modes(loops: Loop, ratio: Array) -> list[_Modes]:
    """Return the partial fractions of each plant of a batch of one axis."""
    p, plant, size = fed(loops, ratio), loops.plant, loops.batch
    tanks, N, n = len(plant.tanks), p.A.shape[-1], plant.mass.shape[-1]
    A, y = np.broadcast_to(p.A, (*size, N, N)), np.broadcast_to(p.c, (*size, N))
    C = np.zeros((*size, 2 + tanks, N))
    C[:, np.arange(2, 2 + tanks), np.arange(N)[plant.slosh_states]] = 1.0
    pushed = np.zeros((*size, n, tanks))
    pushed[:, np.arange(n)[plant.slosh], np.arange(tanks)] = plant.tank_mass
    B = np.zeros((*size, N, 2 + tanks))
    B[..., 0], B[..., 1], B[:, N - n :, 2:] = p.B, p.B2, np.linalg.solve(plant.mass, pushed)
    at_once, attitude, kept = np.zeros((*size, 2, 2 + tanks)), np.zeros((*size, 2)), np.ones(N, dtype=bool)
    at_once[:, 0, 0], at_once[:, 0, 1] = p.d, p.d2
    if p.acceleration is not None:
        at_once[:, 0, 2:] = np.einsum("...i,...ij->...j", p.acceleration, B[:, N - n :, 2:])
    turn = [plant.slosh_states.start - 1, N - n + plant.first_tank - 1]  # phi and phi'
    if not np.any(A[:, :, turn[0]]) and np.all(np.count_nonzero(A[:, :, turn[1]], axis=-1) == 1):
        # nothing holds the attitude: its two poles at the origin share an eigenvector, and are written as 1/s^2
        kept[turn], attitude = False, y[:, turn]
        C[:, 1], at_once[:, 1] = A[:, turn[1]], B[:, turn[1]]
    C[:, 0] = y
    poles, right = (x.astype(complex) for x in np.linalg.eig(A[:, kept][:, :, kept]))
    inputs = np.swapaxes(np.linalg.solve(right, B[:, kept].astype(complex)), -1, -2)
    residues = (C[:, :, kept] @ right)[..., None, :] * inputs[:, None]
    inertial = bool(np.any(plant.inertial_force))
    return [
        _in_reals(poles[k], residues[k].reshape(-1, poles.shape[-1]), at_once[k], attitude[k], inertial)
        for k in range(size[0])
    ]


def _in_reals(poles: ComplexArray, residues: ComplexArray, at_once: Array, attitude: Array, inertial: bool) -> _Modes:
    """Join conjugate pairs: (2 Re R s - 2 Re(R p*)) / (s^2 - 2 Re p s + |p|^2)."""
    upper, real = poles.imag > 0.0, poles.imag == 0.0
    R = residues[:, upper]
    weights = [-2.0 * (R * np.conj(poles[upper])).real, 2.0 * R.real, residues[:, real].real]
    return _Modes(
        poles=np.concatenate([poles[upper], poles[real]]),
        real=np.arange(np.sum(upper | real)) >= np.sum(upper),
        weights=np.concatenate(weights, axis=1),
        at_once=at_once,
        attitude=attitude,
        inertial=inertial,
    )
