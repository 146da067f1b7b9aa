"""Many trajectories at once: exact linear flow in modal coordinates, damping as kicks between half flows (Strang).

Eight trajectories run side by side in every innermost loop, which the compiler turns into vector instructions. Compiled
once and kept in numba's cache.
"""

import numba
import numpy as np

from sloshpy.units import Array

LANES = 8
KEPT = 48  # last maxima and minima of each signal


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def march(
    start_re: Array,
    start_im: Array,
    flow_re: Array,
    flow_im: Array,
    velocity_re: Array,
    velocity_im: Array,
    push_re: Array,
    push_im: Array,
    coupling: Array,
    coefficient: Array,
    exponent: Array,
    signal_re: Array,
    signal_im: Array,
    slope_re: Array,
    slope_im: Array,
    h: Array,
    steps: int,
    far: float,
    high: Array,
    high_at: Array,
    high_count: Array,
    low: Array,
    low_count: Array,
    largest: Array,
    diverged: Array,
) -> None:
    """March groups of eight trajectories; results go into the last seven arrays.

    Shapes, with G groups, m modes, n tanks, K terms of a law, S signals and 8 lanes last: start, flow (G, m, 8);
    velocity, push (G, n, m, 8); coupling (G, n, n, 8): change of velocity i by a unit kick on tank j; coefficient,
    exponent (n, K): force -c |v|^p v; signal, slope (G, S, m, 8): rows of the watched signals and their derivatives;
    h (G, 8): s; high, high_at, low (G, S, KEPT, 8): last maxima, their steps, minima; counts (G, S, 8); largest
    (G, S, 8): greatest magnitude of each signal; diverged (G, 8): step at which a signal went beyond `far`, else -1.
    """
    groups, modes = start_re.shape[0], start_re.shape[1]
    n, watched = coefficient.shape[1], signal_re.shape[1]
    for g in range(groups):
        y, x = start_re[g].copy(), start_im[g].copy()
        v, kick = np.zeros((n, LANES)), np.zeros((n, LANES))
        value, slope = np.zeros((watched, LANES)), np.zeros((watched, LANES))
        old, old_slope = np.zeros((watched, LANES)), np.zeros((watched, LANES))
        rate = np.zeros(LANES)
        for k in range(steps + 1):
            if k > 0:
                _flow(y, x, flow_re[g], flow_im[g])
                for j in range(n):
                    v[j, :] = 0.0
                    kick[j, :] = 0.0
                    for m in range(modes):
                        for lane in range(LANES):
                            v[j, lane] += (
                                velocity_re[g, j, m, lane] * y[m, lane] - velocity_im[g, j, m, lane] * x[m, lane]
                            )
                for sweep in range(2):  # forward and back: symmetric in time
                    for turn in range(n):
                        j = turn if sweep == 0 else n - 1 - turn
                        for lane in range(LANES):
                            here = abs(v[j, lane])
                            grip = _grip(coefficient[g, j], exponent[j], lane, here)
                            reach = 0.25 * h[g, lane] * coupling[g, j, j, lane]
                            here = here * np.exp(-grip * reach)  # to the middle of the kick
                            grip = _grip(coefficient[g, j], exponent[j], lane, here)
                            rate[lane] = v[j, lane] * (np.exp(-grip * 2.0 * reach) - 1.0) / coupling[g, j, j, lane]
                            kick[j, lane] += rate[lane]
                        for i in range(n):
                            for lane in range(LANES):
                                v[i, lane] += coupling[g, i, j, lane] * rate[lane]
                for j in range(n):
                    for m in range(modes):
                        for lane in range(LANES):
                            y[m, lane] += push_re[g, j, m, lane] * kick[j, lane]
                            x[m, lane] += push_im[g, j, m, lane] * kick[j, lane]
                _flow(y, x, flow_re[g], flow_im[g])
            for q in range(watched):
                old[q, :] = value[q, :]
                old_slope[q, :] = slope[q, :]
                value[q, :] = 0.0
                slope[q, :] = 0.0
                for m in range(modes):
                    for lane in range(LANES):
                        value[q, lane] += signal_re[g, q, m, lane] * y[m, lane] - signal_im[g, q, m, lane] * x[m, lane]
                        slope[q, lane] += slope_re[g, q, m, lane] * y[m, lane] - slope_im[g, q, m, lane] * x[m, lane]
                for lane in range(LANES):
                    size = abs(value[q, lane])
                    if size > largest[g, q, lane]:
                        largest[g, q, lane] = size
                    if not size < far and diverged[g, lane] < 0:
                        diverged[g, lane] = k
                    if k > 0 and old_slope[q, lane] * slope[q, lane] < 0.0:
                        at, peak = _extremum(
                            old[q, lane], value[q, lane], old_slope[q, lane], slope[q, lane], h[g, lane]
                        )
                        if slope[q, lane] < 0.0:
                            slot = high_count[g, q, lane] % KEPT
                            high[g, q, slot, lane] = peak
                            high_at[g, q, slot, lane] = (k - 1) * h[g, lane] + at
                            high_count[g, q, lane] += 1
                        else:
                            low[g, q, low_count[g, q, lane] % KEPT, lane] = peak
                            low_count[g, q, lane] += 1


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
def _flow(y: Array, x: Array, re: Array, im: Array) -> None:
    """Turn every mode by half a step."""
    for m in range(y.shape[0]):
        for lane in range(LANES):
            a = re[m, lane] * y[m, lane] - im[m, lane] * x[m, lane]
            x[m, lane] = re[m, lane] * x[m, lane] + im[m, lane] * y[m, lane]
            y[m, lane] = a


@numba.njit(cache=True, error_model="numpy")
def _extremum(a: float, b: float, da: float, db: float, h: float) -> tuple[float, float]:
    """Return time and value of the extremum of the cubic through two values and slopes of opposite sign."""
    c2 = 3.0 * (b - a) - h * (2.0 * da + db)
    c3 = 2.0 * (a - b) + h * (da + db)
    low, high = 0.0, 1.0
    t = da / (da - db)
    for _ in range(30):  # Newton's method on the slope, kept within the step
        f = h * da + 2.0 * c2 * t + 3.0 * c3 * t * t
        if (f > 0.0) == (da > 0.0):
            low = t
        else:
            high = t
        df = 2.0 * c2 + 6.0 * c3 * t
        new = t - f / df if df != 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - t) < 1e-12:
            t = new
            break
        t = new
    return t * h, a + t * (h * da + t * (c2 + t * c3))
