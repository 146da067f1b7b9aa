"""One trajectory of a loop whose coefficients change with time: Runge-Kutta steps of order four, a true delay line.

    x' = (1 - p) x'(x; loop at t_k) + p x'(x; loop at t_k+1)   less (m_j' / m_j) z_j' where z_j'' stands

with p the part of the interval that has passed. What goes into the delay line is kept with its slope and comes out of
the cubic between two steps. No sum is rounded otherwise than written, so that a trajectory's bits depend on itself
alone. Compiled once and kept in numba's cache.
"""

from typing import NamedTuple

import numba
import numpy as np

from sloshpy.autopilot.motion import actuator_motion
from sloshpy.simulation.law_terms import LawTerms
from sloshpy.units import Array, IntArray

NUDGE = 1e-3  # of a step, over which the slope of the command is taken
DIVERGED, BEYOND = 1, 2  # how a trajectory ends early: beyond every bound, or beyond its damping data

# numba's cache looks at the date of this file alone: whoever changes `actuator_motion` touches this file too
_motion = numba.njit(cache=True, error_model="numpy")(actuator_motion)


class Tables(NamedTuple):
    """A loop of N states and n tanks at T times, linear between them.

    time, delay: (T,), s; delay 0 everywhere where there is no line. loss: (T-1, n), d ln m / dt, 1/s. by_state:
    (T, N, N), x' on x, transposed. by_input: (T, 2 + n, N), on command (or the engine's acceleration), wind and damping
    accelerations. command: (T, N + 1 + n), engine: (T, N + 1), as in `Matrices`. limits: (T, 5), likewise, (T, 0) of an
    engine without.
    """

    time: Array
    delay: Array
    loss: Array
    by_state: Array
    by_input: Array
    command: Array
    engine: Array
    limits: Array


class Line(NamedTuple):
    """What went into the delay line before this march: times in s, values in rad and slopes of stretches in turn.

    start: where each stretch begins in them, and their length at the end; none before the first.
    """

    time: Array
    value: Array
    slope: Array
    start: IntArray


@numba.njit(cache=True, error_model="numpy")
def march_varying(
    begin: Array,
    steps: Array,
    emptied: int,
    tables: Tables,
    laws: LawTerms,
    first_velocity: int,
    gust: Array,
    before: Line,
    far: float,
    state: Array,
    angle: Array,
    value: Array,
    slope: Array,
) -> tuple[int, int]:
    """March from a state (N,) over the times `steps` (S,) in s; return how many were reached and how it ended.

    emptied: steps in which the line still holds what is of `before`. first_velocity: where z_1' stands in the state.
    gust: peak in m/s, start and duration in s of a 1-cosine gust. far: m or rad, beyond which the motion has diverged.
    Into state (S, N), angle of the engine (S,), value and slope (S,) of the command go the results. The second number
    returned is 0, or `DIVERGED` or `BEYOND` where the step behind the last one reached is neither finite nor near.
    """
    late = False
    for tau in tables.delay:
        late = late or tau > 0.0
    N, n, S = len(begin), tables.loss.shape[1], len(steps)
    x, at, force = begin.copy(), np.empty(N), np.empty(n)
    k1, k2, k3, k4 = np.empty(N), np.empty(N), np.empty(N), np.empty(N)
    k = 0
    for i in range(S):
        t = steps[i]
        k = _interval(tables.time, k, t)
        h = steps[i + 1] - t if i + 1 < S else t - steps[i - 1]
        old = i < emptied
        out = _delayed(t, k, i, old, late, tables, before, steps, value, slope)
        wind = _wind(gust, t)
        _slope(k1, x, t, k, out, late, wind, tables, laws, first_velocity, force)
        here = _commanded(x, t, k, wind, tables, laws, first_velocity, force)
        state[i], value[i] = x, here
        angle[i] = _engine(x, t, k, out if late else here, tables)
        at[:] = x + NUDGE * h * k1
        slope[i] = _commanded(at, t, k, wind, tables, laws, first_velocity, force)
        at[:] = x - NUDGE * h * k1
        slope[i] -= _commanded(at, t, k, wind, tables, laws, first_velocity, force)
        slope[i] /= 2.0 * NUDGE * h
        if i + 1 == S:
            break
        middle, end = t + 0.5 * h, t + h
        out = _delayed(middle, k, i + 1, old, late, tables, before, steps, value, slope)
        wind = _wind(gust, middle)
        at[:] = x + 0.5 * h * k1
        _slope(k2, at, middle, k, out, late, wind, tables, laws, first_velocity, force)
        at[:] = x + 0.5 * h * k2
        _slope(k3, at, middle, k, out, late, wind, tables, laws, first_velocity, force)
        out = _delayed(end, k, i + 1, old, late, tables, before, steps, value, slope)
        at[:] = x + h * k3
        _slope(k4, at, end, k, out, late, _wind(gust, end), tables, laws, first_velocity, force)
        x += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        if tables.limits.shape[1] > 0:  # the engine at its stop and at its fastest
            stop, fastest = tables.limits[k, 2], tables.limits[k, 3]
            x[N - 2] = min(max(x[N - 2], -stop), stop)
            x[N - 1] = min(max(x[N - 1], -fastest), fastest)
        for r in range(N):
            if not abs(x[r]) < far:
                return i + 1, _fate(x)
    return S, 0


@numba.njit(cache=True, error_model="numpy")
def _fate(x: Array) -> int:
    for one in x:
        if np.isnan(one):
            return BEYOND
    return DIVERGED


@numba.njit(cache=True, error_model="numpy")
def _interval(time: Array, k: int, t: float) -> int:
    """Return the interval that holds a time, from one on that it does not lie before."""
    while k < len(time) - 2 and t >= time[k + 1]:
        k += 1
    return k


@numba.njit(cache=True, error_model="numpy")
def _part(time: Array, k: int, t: float) -> float:
    part: float = (min(t, time[-1]) - time[k]) / (time[k + 1] - time[k])
    return part


@numba.njit(cache=True, error_model="numpy")
def _wind(gust: Array, t: float) -> float:
    part, speed = (t - gust[1]) / gust[2], 0.0
    if 0.0 < part < 1.0:
        speed += 0.5 * gust[0] * (1.0 - np.cos(2.0 * np.pi * part))
    return speed


@numba.njit(cache=True, error_model="numpy")
def _forces(force: Array, x: Array, k: int, laws: LawTerms, first_velocity: int) -> None:
    """Put in the damping acceleration of each tank by its law at one time; nan beyond what a law knows."""
    for j in range(len(force)):
        v = x[first_velocity + j]
        speed, total = abs(v), 0.0
        for i in range(laws.coefficient.shape[2]):
            c = laws.coefficient[k, j, i]
            if laws.table[k, j, i] >= 0:
                total -= c * _tabulated(speed, laws.frequency[k, j, i], laws.table[k, j, i], laws) * v
            elif speed <= laws.fastest[k, j, i]:
                p = laws.exponent[k, j, i]
                total -= c * (1.0 if p == 0.0 else speed if p == 1.0 else speed**p) * v
            else:
                total = np.nan
        force[j] = total


@numba.njit(cache=True, error_model="numpy")
def _tabulated(speed: float, frequency: float, table: int, laws: LawTerms) -> float:
    """Return h of a table's force -h v, 1/s."""
    first, last = laws.first[table], laws.first[table + 1] - 1
    u = speed / frequency
    if not u <= laws.node[last]:
        return np.nan
    low, high = first, last
    while high - low > 1:
        middle = (low + high) // 2
        if laws.node[middle] <= u:
            low = middle
        else:
            high = middle
    a, y = laws.cubic[low], u - laws.node[low]
    grip: float = frequency * (a[3] + y * (a[2] + y * (a[1] + y * a[0])))
    return grip


@numba.njit(cache=True, error_model="numpy")
def _at_one(x: Array, k: int, wind: float, tables: Tables, laws: LawTerms, first_velocity: int, force: Array) -> float:
    """Return the command in rad by the loop at one time, and put its damping accelerations into `force`."""
    N, row = len(x), tables.command[k]
    _forces(force, x, k, laws, first_velocity)
    total: float = row[N] * wind
    for c in range(N):
        total += row[c] * x[c]
    for j in range(len(force)):
        if row[N + 1 + j] != 0.0:
            total += row[N + 1 + j] * force[j]
    return total


@numba.njit(cache=True, error_model="numpy")
def _commanded(
    x: Array, t: float, k: int, wind: float, tables: Tables, laws: LawTerms, first_velocity: int, force: Array
) -> float:
    """Return the engine command before the delay, rad."""
    part = _part(tables.time, k, t)
    one = _at_one(x, k, wind, tables, laws, first_velocity, force)
    other = _at_one(x, k + 1, wind, tables, laws, first_velocity, force)
    return (1.0 - part) * one + part * other


@numba.njit(cache=True, error_model="numpy")
def _engine(x: Array, t: float, k: int, command: float, tables: Tables) -> float:
    part, N = _part(tables.time, k, t), len(x)
    one: float = tables.engine[k, N] * command
    other: float = tables.engine[k + 1, N] * command
    for c in range(N):
        one += tables.engine[k, c] * x[c]
        other += tables.engine[k + 1, c] * x[c]
    return (1.0 - part) * one + part * other


@numba.njit(cache=True, error_model="numpy")
def _slope(
    found: Array,
    x: Array,
    t: float,
    k: int,
    delayed: float,
    late: bool,
    wind: float,
    tables: Tables,
    laws: LawTerms,
    first_velocity: int,
    force: Array,
) -> None:
    """Put in x' at a time; `delayed` is what comes out of the line in rad, where there is one."""
    k = _interval(tables.time, k, t)
    part, N, limited = _part(tables.time, k, t), len(x), tables.limits.shape[1] > 0
    found[:] = 0.0
    rate, acceleration = 0.0, 0.0
    for e in range(2):
        share = part if e == 1 else 1.0 - part
        command = _at_one(x, k + e, wind, tables, laws, first_velocity, force)
        if late:
            command = delayed
        if limited:
            w, xi, stop, fastest, band = tables.limits[k + e]
            fast, command = _motion(x[N - 2], x[N - 1], command, w, xi, stop, fastest, band)
            rate += share * fast
            acceleration += share * command
        for c in range(N):
            y, row = share * x[c], tables.by_state[k + e, c]
            for r in range(N):
                found[r] += row[r] * y
        for c in range(2 + len(force)):
            y, row = share * (command if c == 0 else wind if c == 1 else force[c - 2]), tables.by_input[k + e, c]
            for r in range(N):
                found[r] += row[r] * y
    if limited:
        found[N - 2], found[N - 1] = rate, acceleration
    for j in range(len(force)):
        found[first_velocity + j] -= tables.loss[k, j] * x[first_velocity + j]


@numba.njit(cache=True, error_model="numpy")
def _delayed(
    t: float,
    k: int,
    told: int,
    old: bool,
    late: bool,
    tables: Tables,
    before: Line,
    steps: Array,
    value: Array,
    slope: Array,
) -> float:
    """Return the command that comes out of the line at a time, rad; of the march itself `told` steps are known."""
    if not late:
        return 0.0
    k = _interval(tables.time, k, t)
    part = _part(tables.time, k, t)
    then = t - (tables.delay[k] + part * (tables.delay[k + 1] - tables.delay[k]))
    if not old:
        return _cubic(then, steps, value, slope, 0, told)
    for s in range(len(before.start) - 2, -1, -1):
        if before.time[before.start[s]] <= then:
            return _cubic(then, before.time, before.value, before.slope, before.start[s], before.start[s + 1])
    return 0.0


@numba.njit(cache=True, error_model="numpy")
def _cubic(then: float, time: Array, value: Array, slope: Array, first: int, end: int) -> float:
    """Return the cubic through values and slopes of the two steps beside a time, of those from `first` to `end`."""
    if end - first == 1:
        only: float = value[first]
        return only
    low, high = first, end - 1
    while high - low > 1:
        middle = (low + high) // 2
        if time[middle] <= then:
            low = middle
        else:
            high = middle
    h = time[low + 1] - time[low]
    y = (then - time[low]) / h
    a, b, c, d = value[low], h * slope[low], value[low + 1], h * slope[low + 1]
    found: float = a + y * (b + y * (3.0 * (c - a) - 2.0 * b - d + y * (2.0 * (a - c) + b + d)))
    return found
