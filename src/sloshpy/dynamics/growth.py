"""The greatest growth of a loop, and whether it is stable: only the poles that decide are made exact."""

import numpy as np

from sloshpy.autopilot import PADE_ORDER, delay_error
from sloshpy.dynamics.characteristic import polish
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.states import delay_parts, quiet_within, system_matrix
from sloshpy.units import Array, BoolArray, ComplexArray

NEAR_AXIS = 0.1  # damping ratio: a phase error of 1e-3 rad moves a pole by a hundredth of that
RIGHTMOST = 6  # poles that are polished wherever they are
BRIEF = 0.6  # rad of phase lag up to which an approximation of the delay of order `BRIEF_ORDER` starts near enough
BRIEF_ORDER = 4  # off by 4e-10 there
SURE = 2.5e-4  # damping ratio of every pole above which nothing that is approximated in a brief delay unsettles a loop
SQUARINGS = 14
WIDE = 1e3  # norm of a power beyond which its rounding, at most about 1e-16 WIDE^3 of an eigenvalue, might count
MANY = 12  # states from which squaring is quicker than eigenvalues
TOGETHER = 50  # matrices squared at a time
_ROUNDING = 1e-6  # part of |s| by which the eigenvalue of a double pole may be off, and to spare


def greatest_growth(loop: Loop) -> Array:
    """Return the greatest real part of the closed-loop poles, 1/s, shape of the batch.

    With a delay only poles near the axis are polished, the approximation cannot carry one across from farther left; and
    of these only those that may be the rightmost.
    """
    values, slack = _approximate(loop)
    if slack is None:
        return np.asarray(np.max(values.real, axis=-1))
    near = _near(values)
    exact = np.where(near, -np.inf, values.real)
    first = np.zeros(values.shape, dtype=bool)
    np.put_along_axis(first, np.argmax(np.where(near, values.real, -np.inf), axis=-1)[..., None], True, axis=-1)
    exact[first] = _polished(loop, values, first)
    ahead = values.real + slack >= np.max(exact, axis=-1, keepdims=True)
    others = near & ~first & ahead
    exact[others] = _polished(loop, values, others)
    return np.asarray(np.max(exact, axis=-1))


def is_stable(loop: Loop) -> BoolArray:
    """Return whether every closed-loop pole lies left of the axis, shape of the batch; as by `greatest_growth`."""
    values, slack = _approximate(loop, in_doubt=True)
    growth = values.real.copy()
    if slack is not None:
        doubtful = _near(values) & (np.abs(growth) <= slack)
        growth[doubtful] = _polished(loop, values, doubtful)
    return np.asarray(np.all(growth < 0.0, axis=-1))


def _approximate(loop: Loop, in_doubt: bool = False) -> tuple[ComplexArray, Array | None]:
    """Return the poles with the delay approximated, and how far polishing may move each, 1/s; None without a delay.

    Each loop has the approximation that it needs by itself, so that no digit of it depends on its neighbours; shorter
    lists of poles are filled up with -inf. in_doubt: all of them -inf where the loop is `surely_damped`.
    """
    a, batch, size = loop.autopilot, loop.batch, int(np.prod(loop.batch))
    if not np.any(a.dead_time):
        return _eigenvalues(loop, system_matrix(loop)[0], in_doubt), None
    brief = np.zeros(size, dtype=bool) if a.sample_time is not None else quiet_within(loop, BRIEF).reshape(-1)
    parts = np.zeros(size, dtype=int)
    if not np.all(brief):
        parts[~brief] = delay_parts(loop).reshape(-1)[~brief]
    kinds = np.unique(parts)
    if len(kinds) == 1:
        return _of_one_kind(loop, int(kinds[0]), in_doubt)
    found = [(np.flatnonzero(parts == kind), int(kind)) for kind in kinds]
    answers = [(index, *_of_one_kind(loop.take(index), kind, in_doubt)) for index, kind in found]
    width = max(values.shape[-1] for _, values, _ in answers)
    values, slack = np.full((size, width), -np.inf, dtype=complex), np.zeros((size, width))
    for index, some, moves in answers:
        values[index, : some.shape[-1]], slack[index, : some.shape[-1]] = some, moves
    return values.reshape(*batch, width), slack.reshape(*batch, width)


def _of_one_kind(loop: Loop, parts: int, in_doubt: bool) -> tuple[ComplexArray, Array]:
    """Return the same for loops whose delay takes so many parts, 0 for one of order `BRIEF_ORDER`.

    A double pole moves by the root of what disturbs the loop.
    """
    order = PADE_ORDER if parts else BRIEF_ORDER
    A, _ = system_matrix(loop, delay=(max(parts, 1), order))
    values = _eigenvalues(loop, A, in_doubt and not parts)
    if loop.autopilot.sample_time is not None:  # filters and hold are approximated too, and without a bound
        return values, np.full(values.shape, np.inf)
    found, slack = np.isfinite(values), np.zeros(values.shape)
    delay = np.broadcast_to(np.asarray(loop.autopilot.dead_time)[..., None], values.shape)[found]
    error = delay_error(delay, values[found], max(parts, 1), order)
    slack[found] = np.abs(values[found]) * (_ROUNDING + 10.0 * np.sqrt(error))
    return values, slack


def _eigenvalues(loop: Loop, A: Array, in_doubt: bool) -> ComplexArray:
    """Return the eigenvalues of state matrices of loops, -inf where they are in no doubt."""
    if not in_doubt or A.shape[-1] < MANY or not loop.plant.tanks:
        return np.linalg.eigvals(A).astype(complex)
    values = np.full(A.shape[:-1], -np.inf, dtype=complex)
    rest = ~surely_damped(A, np.mean(loop.plant.tank_frequency, axis=-1))
    values[rest] = np.linalg.eigvals(A[rest])
    return values


def surely_damped(A: Array, rate: Array) -> BoolArray:
    """Return where every eigenvalue of A, (..., N, N), certainly has a damping ratio above `SURE`.

    With C = (c - A)^-1 (c + A) an eigenvalue of damping ratio zeta becomes one of |mu|^2 >= (1 - zeta)/(1 + zeta),
    whatever c; equal at |lambda| = c. No power of C has an eigenvalue greater than its norm:

        |C^n| < ((1 - SURE)/(1 + SURE))^(n/2)   leaves none with zeta <= SURE

    A few products, which cost a third of the eigenvalues. Nothing is said of the others.

    Args:
        rate: c, about where the lightest damping is, (...), 1/s.
    """
    size, N = A.shape[:-2], A.shape[-1]
    matrices, c = A.reshape(-1, N, N), np.broadcast_to(rate, size).reshape(-1, 1, 1) * np.eye(N)
    sure = [_by_squaring(matrices[k : k + TOGETHER], c[k : k + TOGETHER]) for k in range(0, len(matrices), TOGETHER)]
    return np.concatenate(sure).reshape(size)


def _by_squaring(A: Array, c: Array) -> BoolArray:
    """Return the same for a few matrices, (k, N, N), that stay in the processor's cache."""
    try:
        C = np.asarray(np.linalg.solve(c - A, c + A), dtype=float)
    except np.linalg.LinAlgError:  # an eigenvalue at c
        return np.zeros(len(A), dtype=bool)
    most, other = _norms(C), np.empty_like(C)
    with np.errstate(all="ignore"):  # powers of the unstable grow without bound
        for _ in range(SQUARINGS):
            C, other = np.matmul(C, C, out=other), C
            most = np.maximum(most, _norms(C))
        bound = ((1.0 - SURE) / (1.0 + SURE)) ** (0.5 * 2**SQUARINGS)
        return np.asarray((most < WIDE) & (_norms(C) < bound))


def _norms(C: Array) -> Array:
    entries = C.reshape(len(C), -1)
    return np.asarray(np.sqrt(np.vecdot(entries, entries)))


def _near(values: ComplexArray) -> BoolArray:
    growth = values.real
    rank = np.argsort(np.argsort(-growth, axis=-1), axis=-1)
    return np.asarray((growth > -NEAR_AXIS * np.abs(values)) | (rank < RIGHTMOST))


def _polished(loop: Loop, values: ComplexArray, chosen: BoolArray) -> Array:
    """Return the exact growth of the chosen poles, -inf of one that is the approximation's alone."""
    owner = np.broadcast_to(np.arange(int(np.prod(loop.batch))).reshape(*loop.batch, 1), values.shape)[chosen]
    exact = polish(loop.take(owner), values[chosen]).real
    return np.where(np.isnan(exact), -np.inf, exact)
