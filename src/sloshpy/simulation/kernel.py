"""Many trajectories at once: exact linear flow in modal coordinates, damping as kicks between the flows (Strang).

    kick 1/2 - flow h - kick - flow h - kick - ... - flow h - kick 1/2

Everything is read in the middle of a kick: before or after it the engine, which the kick of a velocity moves at once,
would be off by the first order of the step. Trajectories lie side by side on the last axis of every array; each
innermost loop runs over them and is turned into vector instructions. Nothing in them is rounded otherwise than written,
so that a trajectory's bits depend neither on its place nor on the width of the vectors. Compiled once and kept in
numba's cache.
"""

import math

import numba
import numpy as np

from sloshpy.units import Array

LANES = 64  # most trajectories of a group: its few loops are long, and some ten modes stay in the nearer caches
KEPT = 21  # last maxima and minima of each signal: what the envelope of the last twenty cycles asks for


@numba.njit(cache=True, error_model="numpy")
def march(
    start: Array,
    flow: Array,
    push: Array,
    rows: Array,
    jump: Array,
    coefficient: Array,
    exponent: Array,
    gust: Array,
    h: float,
    steps: int,
    far: float,
    high: Array,
    high_at: Array,
    low: Array,
    count: Array,
    largest: Array,
    diverged: Array,
) -> None:
    """March groups of trajectories from rest; results go into the last six arrays.

    Shapes, with G groups, Q fours of modes, n tanks, K terms of a law, S = n + 1 signals and L lanes last: start, flow
    (G, Q, 8 L): real and imaginary part of each mode in turn; push (G, n, Q, 8 L), likewise; rows (G, n + 1, Q, 16 L),
    by whose product with the modes the R = 2 n + 2 numbers are read, in pairs: velocity of each slosh mass, its
    displacement, engine angle, its rate; of each mode real and imaginary part for the first of a pair, then for the
    second, the imaginary part with its sign; jump (G, R, n, L): of these by a unit kick on a tank; coefficient
    (G, n, K, L), exponent (n, K): force -c |v|^p v; gust (G, E, 3, L): peak in m/s, start and duration in s of none
    or one, whose place in push and jump is behind the tanks; h: s; high, high_at, low (G, S, KEPT, L): last maxima,
    their times in s, minima; count (G, S, 2, L): how many maxima and minima; largest (G, S, L): greatest magnitude of
    each signal; diverged (G, L): step at which a signal went beyond `far`, else -1.
    """
    n, kicked, lanes = coefficient.shape[1], push.shape[1], jump.shape[3]
    pairs, kick, work = np.zeros((n + 1, 2 * lanes)), np.zeros((kicked, lanes)), np.zeros((n, lanes))
    read = pairs.reshape(2 * n + 2, lanes)
    value, slope = np.zeros((n + 1, lanes)), np.zeros((n + 1, lanes))
    old, old_slope = np.zeros((n + 1, lanes)), np.zeros((n + 1, lanes))
    for g in range(start.shape[0]):
        state = start[g].copy()
        for k in range(steps + 1):
            _read(pairs, rows[g], state)
            if k > 0:
                for j in range(n, kicked):
                    _blow(kick[j], gust[g, j - n], k * h, h)
                _kicks(kick, work, read, jump[g], coefficient[g], exponent, h)
            else:
                kick[:] = 0.0  # at rest
            old, value, old_slope, slope = value, old, slope, old_slope
            _middle(value, slope, read, kick, jump[g], h)
            result = high[g], high_at[g], low[g], count[g], largest[g], diverged[g]
            _watch(value, slope, old, old_slope, k, h, far, *result)
            _move(state, push[g], kick, flow[g])


@numba.njit(cache=True, error_model="numpy")
def _read(pairs: Array, rows: Array, state: Array) -> None:
    """Put the products of rows and modes into `pairs`, four modes and two rows at a time.

    Few long loops over few arrays: the compiler asks before each whether the arrays overlap.
    """
    lanes = pairs.shape[1] // 2
    for p in range(rows.shape[0]):
        out = pairs[p]
        for i in range(2 * lanes):
            out[i] = 0.0
        for q in range(state.shape[0]):
            c, x = rows[p, q], state[q]
            for i in range(lanes):
                a0, b0, a1, b1 = x[i], x[lanes + i], x[2 * lanes + i], x[3 * lanes + i]
                a2, b2, a3, b3 = x[4 * lanes + i], x[5 * lanes + i], x[6 * lanes + i], x[7 * lanes + i]
                first = c[i] * a0 + c[lanes + i] * b0 + (c[4 * lanes + i] * a1 + c[5 * lanes + i] * b1)
                second = c[2 * lanes + i] * a0 + c[3 * lanes + i] * b0
                second += c[6 * lanes + i] * a1 + c[7 * lanes + i] * b1
                third = (
                    c[8 * lanes + i] * a2 + c[9 * lanes + i] * b2 + (c[12 * lanes + i] * a3 + c[13 * lanes + i] * b3)
                )
                fourth = c[10 * lanes + i] * a2 + c[11 * lanes + i] * b2
                fourth += c[14 * lanes + i] * a3 + c[15 * lanes + i] * b3
                out[i] += first + third
                out[lanes + i] += second + fourth


@numba.njit(cache=True, error_model="numpy")
def _move(state: Array, push: Array, kick: Array, flow: Array) -> None:
    """Give the modes the kicks of all tanks and let them flow for a step."""
    lanes = kick.shape[1]
    for j in range(kick.shape[0]):
        k = kick[j]
        for q in range(state.shape[0]):
            x, p = state[q], push[j, q]
            for part in range(8):
                for i in range(lanes):
                    x[part * lanes + i] += p[part * lanes + i] * k[i]
    for q in range(state.shape[0]):
        x, f = state[q], flow[q]
        for m in range(4):
            re, im = 2 * m * lanes, (2 * m + 1) * lanes
            for i in range(lanes):
                a, b = x[re + i], x[im + i]
                x[re + i] = f[re + i] * a - f[im + i] * b
                x[im + i] = f[re + i] * b + f[im + i] * a


@numba.njit(cache=True, error_model="numpy")
def _kicks(kick: Array, work: Array, read: Array, jump: Array, coefficient: Array, exponent: Array, h: float) -> None:
    """Put into `kick` (n, L) the integral of each tank's force over a step, its velocity driven by nothing else.

    One after another, forth and back with half the step, which is symmetric in time. A single square law |v| v is
    followed exactly, v / (1 + h c |v|); others by an exponential at the middle of the kick.
    """
    n, lanes = work.shape
    given = np.empty(lanes)
    kick[:n] = 0.0
    work[:] = read[:n]
    for j in range(n, len(kick)):  # half a gust before the damping and half behind it
        for i in range(n):
            for lane in range(lanes):
                work[i, lane] += 0.5 * jump[i, j, lane] * kick[j, lane]
    square = exponent.shape[1] == 1 and np.all(exponent == 1.0)
    sweeps = 1 if n == 1 else 2
    part = h / sweeps
    for turn in range(sweeps * n):
        j = turn if turn < n else 2 * n - 1 - turn
        if square:
            for lane in range(lanes):
                drag = part * coefficient[j, 0, lane] * abs(work[j, lane])
                given[lane] = -drag * work[j, lane] / (1.0 + drag * jump[j, j, lane])
        else:
            for lane in range(lanes):
                v, own = work[j, lane], jump[j, j, lane]
                here = abs(v) * np.exp(-0.5 * part * own * _grip(coefficient[j], exponent[j], lane, abs(v)))
                given[lane] = v * np.expm1(-part * own * _grip(coefficient[j], exponent[j], lane, here)) / own
        for lane in range(lanes):
            kick[j, lane] += given[lane]
        for i in range(n):
            for lane in range(lanes):
                work[i, lane] += jump[i, j, lane] * given[lane]


@numba.njit(cache=True, error_model="numpy")
def _blow(kick: Array, gust: Array, time: float, h: float) -> None:
    """Put into `kick` (L,) what gusts (3, L), (1 - cos) / 2 of their peak, give in a step about a time in s."""
    for lane in range(len(kick)):
        part = (time - gust[1, lane]) / gust[2, lane]
        kick[lane] = 0.5 * h * gust[0, lane] * (1.0 - np.cos(2.0 * np.pi * part)) if 0.0 < part < 1.0 else 0.0


@numba.njit(cache=True, error_model="numpy")
def _grip(coefficient: Array, exponent: Array, lane: int, speed: float) -> float:
    """Return h(|v|) of a law's force -h(|v|) v of one lane, the sum of its power terms."""
    grip = 0.0
    for i in range(len(exponent)):
        if exponent[i] == 1.0:
            grip += coefficient[i, lane] * speed
        elif coefficient[i, lane] != 0.0:
            grip += coefficient[i, lane] * speed ** exponent[i]
    return grip


@numba.njit(cache=True, error_model="numpy")
def _middle(value: Array, slope: Array, read: Array, kick: Array, jump: Array, h: float) -> None:
    """Put in the signals and slopes of the middle of a kick: half of it, its mean force in the engine's slope."""
    n, lanes = len(value) - 1, kick.shape[1]
    for q in range(n + 1):
        at, rising = n + q, q if q < n else 2 * n + 1
        for lane in range(lanes):
            value[q, lane], slope[q, lane] = read[at, lane], read[rising, lane]
        for j in range(len(kick)):
            for lane in range(lanes):
                value[q, lane] += 0.5 * jump[at, j, lane] * kick[j, lane]
                slope[q, lane] += 0.5 * jump[rising, j, lane] * kick[j, lane]
    for j in range(len(kick)):
        for lane in range(lanes):
            slope[n, lane] += jump[2 * n, j, lane] * kick[j, lane] / h


@numba.njit(cache=True, error_model="numpy")
def _watch(
    value: Array,
    slope: Array,
    old: Array,
    old_slope: Array,
    k: int,
    h: float,
    far: float,
    high: Array,
    high_at: Array,
    low: Array,
    count: Array,
    largest: Array,
    diverged: Array,
) -> None:
    """Take in the signals of step k: greatest magnitude, divergence, and an extremum where a slope changed its sign."""
    signals, lanes = value.shape
    for q in range(signals):
        for lane in range(lanes):
            size = abs(value[q, lane])
            largest[q, lane] = size if size > largest[q, lane] else largest[q, lane]
        for lane in range(lanes):
            if old_slope[q, lane] * slope[q, lane] < 0.0 and k > 0:
                at, peak = _extremum(old[q, lane], value[q, lane], old_slope[q, lane], slope[q, lane], h)
                largest[q, lane] = max(largest[q, lane], abs(peak))
                if slope[q, lane] < 0.0:
                    slot = count[q, 0, lane] % KEPT
                    high[q, slot, lane] = peak
                    high_at[q, slot, lane] = (k - 1) * h + at
                    count[q, 0, lane] += 1
                else:
                    low[q, count[q, 1, lane] % KEPT, lane] = peak
                    count[q, 1, lane] += 1
            elif not abs(value[q, lane]) < far and diverged[lane] < 0:
                diverged[lane] = k


@numba.njit(cache=True, error_model="numpy")
def _extremum(a: float, b: float, da: float, db: float, h: float) -> tuple[float, float]:
    """Return time and value of the extremum of the cubic through two values and slopes of opposite sign."""
    c2 = 3.0 * (b - a) - h * (2.0 * da + db)
    c3 = 2.0 * (a - b) + h * (da + db)
    # slope: 3 c3 t^2 + 2 c2 t + h da, of opposite signs at 0 and 1: one root between
    q = -(c2 + math.copysign(math.sqrt(max(c2 * c2 - 3.0 * c3 * h * da, 0.0)), c2))
    t = h * da / q
    if not 0.0 <= t <= 1.0:
        t = min(max(q / (3.0 * c3), 0.0), 1.0)
    return t * h, a + t * (h * da + t * (c2 + t * c3))
