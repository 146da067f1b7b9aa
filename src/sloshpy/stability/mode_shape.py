"""The shape of a closed-loop mode: null vectors of the exact characteristic matrix, delay included."""

from dataclasses import dataclass

import numpy as np

from sloshpy.dynamics.characteristic import characteristic_matrix, polish
from sloshpy.dynamics.loop import Loop
from sloshpy.units import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class NullVectors:
    """One mode of one loop: u T(s) = 0 and T(s) v = 0 with v = [q, beta].

    pole: s in rad/s, polished. separation: second-least singular value of the scaled T over the greatest; 0 where two
    modes coincide, so that neither vector is one mode's.
    """

    pole: complex
    left: ComplexArray
    right: ComplexArray
    separation: float


def null_vectors(loop: Loop, pole: complex) -> NullVectors:
    """Return the shape of the mode of one loop at a pole in rad/s; `pole` must be finite."""
    exact = complex(polish(loop.along(), np.array([pole]))[0])
    s = exact if np.isfinite(exact) else pole
    T = characteristic_matrix(loop, np.asarray(s))[0]
    row, column = np.ones(len(T)), np.ones(len(T))
    for _ in range(3):  # entries of one size: kilograms, metres and radians stand in one matrix
        row /= np.maximum(np.max(np.abs(row[:, None] * T * column), axis=1), 1e-300)
        column /= np.maximum(np.max(np.abs(row[:, None] * T * column), axis=0), 1e-300)
    left, singular, right = np.linalg.svd(row[:, None] * T * column)
    return NullVectors(
        pole=s,
        left=np.conj(left[:, -1]) * row,
        right=np.conj(right[-1]) * column,
        separation=float(singular[-2] / singular[0]),
    )


def state_shape(loop: Loop, pole: complex) -> ComplexArray:
    """Return the unit vector [q, beta, q'/|s|, beta'/|s|] of a mode, coordinates weighted by the root of their mass.

    Its square is kinetic energy, the engine counted as a rotation of the whole vehicle, so that shapes of coordinates
    in metres and radians may be compared.
    """
    shape = null_vectors(loop, pole)
    v, s = shape.right.copy(), shape.pole
    mass = np.sqrt(np.diagonal(loop.plant.mass))
    if loop.plant.velocity_only:  # the first unknown is Z', the rotation comes second
        v[0] = v[0] / max(abs(s), 1e-12)
    v = v * np.append(mass, mass[int(loop.plant.velocity_only)])
    both = np.concatenate([v, v * s / max(abs(s), 1e-300)])
    return np.asarray(both / np.linalg.norm(both))


def modal_assurance(one: ComplexArray, other: ComplexArray) -> Array:
    """Return MAC = |x* y|^2 of unit vectors in rows, (K, N) and (M, N) -> (K, M): 1 for the same shape."""
    return np.asarray(np.abs(np.conj(one) @ other.T) ** 2)
