"""The slosh-related band of a tank, and the engine angle per slosh over it: steps three and four of the paper's method.

|beta/z| peaks where the plant has a zero near the axis, that is where this slosh hardly moves whatever the engine does,
and dips at the poles. Peaks and dips are as narrow as the damping that makes them: samples gather about each.
"""

import numpy as np

from sloshpy.case import Criteria
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import slosh_damping
from sloshpy.dynamics.response import transfer
from sloshpy.stability.margins import loop_margins
from sloshpy.stability.nichols import nichols_disc_margin, sampled
from sloshpy.units import Array, ComplexArray


def slosh_band(loop: Loop, criteria: Criteria, *tanks: int) -> Array:
    """Return the intervals with DM below the limit-cycle threshold about the minima of tanks, (K, 2), rad/s.

    An interval that reaches past the frequencies sampled, down to rest or up to half the sampling rate, ends there.
    """
    from scipy.optimize import elementwise  # 0.4 s: only when a limit cycle is wanted

    found = loop_margins(loop, criteria, crossings=False)
    own = found.minima.omega[found.related(*tanks) & (found.minima.value < criteria.limit_cycle_disc_margin)]
    curve = sampled(loop, criteria.gain_margin, criteria.phase_margin)
    omega = np.unique(np.concatenate([curve.omega, own]))

    def above(omega: Array) -> Array:
        L = transfer(loop.along(), 1j * omega).loop
        return nichols_disc_margin(L, criteria.gain_margin, criteria.phase_margin) - criteria.limit_cycle_disc_margin

    value = above(omega)
    at = np.flatnonzero(value[:-1] * value[1:] < 0.0)
    edges = np.asarray(elementwise.find_root(above, (omega[at], omega[at + 1]), tolerances={"xrtol": 1e-14}).x)
    falling = value[at] > 0.0
    starts = np.concatenate([omega[:1][value[:1] < 0.0], edges[falling]])
    ends = np.concatenate([edges[~falling], omega[-1:][value[-1:] < 0.0]])
    holds = np.any((own >= starts[:, None]) & (own <= ends[:, None]), axis=1)
    return np.stack([starts, ends], axis=1)[holds]


def engine_per_slosh(loop: Loop, tank: int, band: Array) -> tuple[Array, Array]:
    """Return frequencies in the intervals of a band, rad/s, and |beta/z| there, rad/m; infinite on an undamped zero.

    They hold the least and the greatest of |beta/z| and of |beta/z| / W, each refined.
    """
    near = np.concatenate([_clusters(p) for p in plant_features(loop, tank)])
    omega = [_of_interval(loop, tank, a, b, near[(near > a) & (near < b)]) for a, b in band]
    all_ = np.concatenate(omega)
    return all_, _ratio(loop, tank, all_)


def inner_peak(omega: Array, value: Array, band: Array) -> float | None:
    """Return where a value peaks inside a band, at more than twice what it is at the ends; None where it does not."""
    k = int(np.argmax(value))
    ends = value[np.isin(omega, band)]
    return float(omega[k]) if value[k] > 2.0 * np.max(ends) else None


def _ratio(loop: Loop, tank: int, omega: Array) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.abs(transfer(loop.along(), 1j * omega).slosh[..., tank]))


def _of_interval(loop: Loop, tank: int, low: float, high: float, near: Array) -> Array:
    """Return samples of one interval: evenly, about the poles and zeros, and at the extremes between them."""
    from scipy.optimize import elementwise  # as above

    omega = np.unique(np.concatenate([np.linspace(low, high, 201), near]))
    value = np.log(_ratio(loop, tank, omega))
    extremes = []
    for sign in (1.0, -1.0):
        for power in (0.0, 1.0):
            y = sign * (value - power * np.log(omega))
            # a cluster sees the top of a peak to a few per cent; what lies lower is not the extreme
            k = 1 + np.flatnonzero((y[1:-1] <= y[:-2]) & (y[1:-1] < y[2:]) & (y[1:-1] < np.min(y) + 0.5))
            k = k[np.isfinite(y[k - 1]) & np.isfinite(y[k]) & np.isfinite(y[k + 1])]
            if len(k):

                def turned(w: Array, sign: float = sign, power: float = power) -> Array:
                    return np.asarray(sign * (np.log(_ratio(loop, tank, w)) - power * np.log(w)))

                bracket = (omega[k - 1], omega[k], omega[k + 1])
                found = elementwise.find_minimum(turned, bracket, tolerances={"xrtol": 1e-12, "frtol": 1e-15})
                extremes.append(found.x)
    return np.unique(np.concatenate([omega, *extremes]))


def _clusters(p: complex) -> Array:
    """Return frequencies about a pole or zero, in steps of its half-width up to half its size."""
    width = max(abs(p.real), 1e-9 * abs(p))
    steps = 0.5 * width * 2.0 ** np.arange(30)
    steps = steps[steps < 0.5 * abs(p)]
    return abs(p.imag) + np.concatenate([-steps, [0.0], steps])


def plant_features(loop: Loop, tank: int) -> ComplexArray:
    """Return the poles of the plant and the zeros from engine to a tank's slosh, of the upper half plane."""
    p = loop.plant
    n = p.mass.shape[-1]
    own = np.zeros(n)
    own[p.slosh.start + tank] = 1.0
    damping = p.damping.copy()
    damping[p.slosh, p.slosh] += np.diag(slosh_damping(p, loop.damping))
    unit = 1.0 / np.sqrt(np.diag(p.mass))  # coordinates of unit kinetic energy: no number dwarfs the others

    def bordered(matrix: Array, column: Array, row: Array) -> Array:
        scaled = unit[:, None] * matrix * unit
        return np.block([[scaled, -(unit * column)[:, None]], [(row * unit)[None], np.zeros((1, 1))]])

    reach = np.max(np.abs(unit * p.force)) or 1.0
    inner = [unit[:, None] * m * unit for m in (p.mass, damping, p.stiffness)]
    nothing = np.zeros(n)
    outer = [
        bordered(p.mass, p.inertial_force / reach, nothing),
        bordered(damping, nothing, nothing),
        bordered(p.stiffness, p.force / reach, own / np.max(own * unit)),
    ]
    both = np.concatenate([_quadratic(*inner), _quadratic(*outer)])
    return np.asarray(both[(both.imag > 0.0) & np.isfinite(both)])


def _quadratic(M: Array, C: Array, K: Array) -> ComplexArray:
    """Return the eigenvalues of s^2 M + s C + K."""
    from scipy.linalg import eigvals  # 0.1 s: only when a limit cycle is wanted

    n, one = len(M), np.eye(len(M))
    A = np.block([[np.zeros((n, n)), one], [-K, -C]])
    B = np.block([[one, np.zeros((n, n))], [np.zeros((n, n)), M]])
    values: ComplexArray = eigvals(A, B).astype(complex)
    return values
