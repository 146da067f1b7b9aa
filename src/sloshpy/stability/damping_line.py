"""Loops that differ by slosh dampings on a line: L and slosh are ratios of polynomials along it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sloshpy.autopilot import forward_transfer
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.partial_fractions import references_on
from sloshpy.units import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class DampingLine:
    """Dampings along the last axis of a batch as base + t direction, the same for every vehicle; t >= 0, (D,)."""

    base: Array
    direction: Array
    t: Array


def damping_line(loop: Loop) -> DampingLine | None:
    """Return the line on which the dampings of a batch lie where only they change along its last axis, else None."""
    batch, xi = loop.batch, loop.damping
    n = len(loop.plant.tanks)
    if not batch or n == 0 or xi.ndim < 2 or xi.shape[-2] != batch[-1] or np.prod(xi.shape[:-2]) != 1:
        return None
    if any(shape and shape[-1] != 1 for shape in loop.others(len(batch))):
        return None
    xi = xi.reshape(batch[-1], n)
    widest = int(np.argmax(np.ptp(xi, axis=0)))
    order = np.argsort(xi[:, widest])
    base, far = xi[order[0]], xi[order[-1]]
    t = xi[:, widest] - base[widest]
    direction = (far - base) / t[order[-1]] if t[order[-1]] > 0.0 else np.zeros(n)
    if np.max(np.abs(base + t[:, None] * direction - xi)) > 1e-15:
        return None
    return DampingLine(base=base, direction=direction, t=t)


@dataclass(frozen=True, kw_only=True)
class Expansion:
    """One vehicle along a line of dampings: -L = (x + j y)/below, |z_j/beta|^2 = slosh_j/below, rising powers of t.

    x, y, below: (2 k + 1, F). slosh: (n_tanks, powers, F); free of t (1, 1, F), only the greatest counts.
    """

    x: Array
    y: Array
    below: Array
    slosh: Array


def expansions(loop: Loop, line: DampingLine, omega: Array) -> Iterator[Expansion]:
    """Yield the expansion of each vehicle, in the order of the flattened batch without its last axis.

    The feedback of t direction closes z = (1 + t M)^-1 z_b with M = Z_a diag(2 s w direction). With e = det(1 + t M) =
    sum e_j t^j it is z e = sum v_j t^j, v_j = e_j z_b - M v_{j-1}; k is the number of tanks that change. Widened by
    conj(e), everything stands above |e|^2.

    Raises:
        LinAlgError: a frequency stands on an undamped pole of the base.
    """
    plants = loop.take(np.arange(0, int(np.prod(loop.batch)), loop.batch[-1]))
    size, s = plants.batch[0], 1j * omega
    changed = slice(None) if np.all(line.direction) else np.flatnonzero(line.direction)
    K = np.broadcast_to(forward_transfer(plants.along().autopilot, s), (size, len(omega)))
    rates = np.broadcast_to(2.0 * plants.plant.tank_frequency * line.direction, (size, len(line.base)))[:, changed]
    for i, reference in enumerate(references_on(plants, omega, line.base)):
        y_b, Y_a, z_b, Z_a = reference(omega)
        rate = s * rates[i][:, None]
        M, row = Z_a[:, changed] * rate, Y_a[changed] * rate  # columns of the tanks that change: the others are zero
        e = _determinant(M[changed])
        v, top = [z_b], [y_b]
        for j in range(1, len(e)):
            top.append(y_b * e[j] - np.sum(row * v[-1][changed], axis=0))
            if j < len(z_b):  # where every tank changes adj(1 + t M) ends one degree earlier
                v.append(z_b * e[j] - _applied(M, v[-1][changed]))
        loops = _product(K[i] * np.array(top), np.conj(e))
        yield Expansion(
            x=np.array(loops.real), y=np.array(loops.imag), below=_squares(list(e[:, None]))[0], slosh=_sloshing(v)
        )


def _determinant(M: ComplexArray) -> ComplexArray:
    """Return the coefficients of det(1 + t M) in rising powers of t, (n + 1, F), of a stack (n, n, F).

    Block by leading block (Berkowitz), without a division:

        | 1 + t A   t C   |
        | t R       1 + t a | = det(1 + t A) (1 + t a - t^2 R C + t^3 R A C - ..)
    """
    e = np.array([np.ones_like(M[0, 0]), M[0, 0]])
    for n in range(1, len(M)):
        A, R, C = M[:n, :n], M[n, :n], M[:n, n]
        grown = np.zeros((n + 2, M.shape[-1]), dtype=complex)
        grown[:-1] = e
        grown[1:] += M[n, n] * e
        for k in range(2, n + 2):
            grown[k:] -= np.sum(R * C, axis=0) * e[: n + 2 - k]
            C = -_applied(A, C) if k < n + 1 else C
        e = grown
    return e


def _applied(B: ComplexArray, z: ComplexArray) -> ComplexArray:
    """Return the products of an (n, k, F) stack with the vectors (k, F)."""
    total = B[:, 0] * z[0]
    for k in range(1, len(z)):
        total += B[:, k] * z[k]
    return np.asarray(total)


def _product(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Return the product of two polynomials, (n, F) and (m, F), as (n + m - 1, F)."""
    total = np.zeros((len(a) + len(b) - 1, a.shape[-1]), dtype=complex)
    for k, one in enumerate(a):
        total[k : k + len(b)] += one * b
    return total


def _squares(v: Sequence[ComplexArray]) -> Array:
    """Return |sum v_j t^j|^2 in rising powers of t, (n, powers, F)."""
    real, imaginary = [x.real.copy() for x in v], [x.imag.copy() for x in v]
    total = np.zeros((len(v[0]), 2 * len(v) - 1, v[0].shape[-1]))
    for a in range(len(v)):
        for b in range(a, len(v)):
            both = real[a] * real[b]
            both += imaginary[a] * imaginary[b]
            total[:, a + b] += both if a == b else 2.0 * both
    return total


def _sloshing(v: list[ComplexArray]) -> Array:
    """Return the squares of the tanks' motions; free of t only the greatest of them counts."""
    slosh = _squares(v)
    return np.max(slosh, axis=0, keepdims=True) if len(v) == 1 else slosh
