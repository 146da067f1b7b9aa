"""Distance from the critical point in the margin-normalised Nichols plane, eq 24, and curves sampled to find it."""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import transfer
from sloshpy.dynamics.sensed import fed
from sloshpy.dynamics.states import system_matrix
from sloshpy.units import Array, BoolArray, ComplexArray, IntArray, Real


def nichols_disc_margin(loop: ComplexArray, gain_margin: Real, phase_margin: Real) -> Array:
    """Return DM = hypot(20 log10|L| / GM_d, dphi / PM_d), eq 24.

    dphi is the distance of the phase to the nearest odd multiple of 180 deg, taken as the angle of -L, which needs no
    modulus. DM is a distance: it does not know on which side of the critical point the curve passes.

    Args:
        loop: L(j omega), any shape.
        gain_margin: wanted gain margin as an amplitude ratio (6 dB is 1.995).
        phase_margin: wanted phase margin in rad.
    """
    # written out: abs and hypot of numpy guard against overflow that no loop comes near, at three times the cost
    gain = np.log(loop.real**2 + loop.imag**2) * (0.5 / np.log(gain_margin))
    phase = np.arctan2(-loop.imag, -loop.real) / phase_margin
    return np.asarray(np.sqrt(gain * gain + phase * phase))


FAR = np.log(1e4)  # of ln |L|: beyond +-80 dB nothing is a margin


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Loop responses of a flattened batch, sorted by loop and then by frequency.

    index: which loop of the flattened batch each point belongs to. omega: rad/s. loop: L(j omega).
    """

    index: IntArray
    omega: Array
    loop: ComplexArray

    def pairs(self) -> IntArray:
        """Return the positions k for which k and k+1 are neighbours on one curve."""
        return np.flatnonzero(self.index[1:] == self.index[:-1])


def sampled(loop: Loop, gain_margin: float, phase_margin: float) -> Curves:
    """Sample every loop of a batch so densely that no feature of eq 24 is missed.

    Frequencies start from the poles and zeros of the loop, open and closed, in steps of their own half-width. Then
    every piece whose ends lie farther apart in the normalised Nichols plane than a fraction of their distance to the
    critical point is halved, until none is left; last, every piece in which a crossing or a minimum may hide. Beyond
    `FAR` no one looks: at the rounded poles of a drifting vehicle, at the origin, L is nothing but rounding.
    """
    index, omega = placed(loop)
    response = transfer(loop.take(index), 1j * omega).loop
    finite = np.isfinite(response) & (response != 0.0)
    curves = Curves(index=index[finite], omega=omega[finite], loop=response[finite])
    for _ in range(40):
        step = _steps(loop, curves, np.arange(len(curves.omega) - 1))
        chord = np.hypot(step.real / np.log(gain_margin), step.imag / phase_margin)
        distance = nichols_disc_margin(curves.loop, gain_margin, phase_margin)
        allowed = allowed_chord(np.minimum(distance[1:], distance[:-1]))
        split = np.flatnonzero((chord > allowed) & _divisible(curves))
        if len(split) == 0:
            break
        curves = _inserted(loop, curves, split, np.sqrt(curves.omega[split] * curves.omega[split + 1]))
    slope = _log_slope(loop, curves)
    among = np.arange(len(curves.omega) - 1)
    for _ in range(16):
        distance = nichols_disc_margin(curves.loop, gain_margin, phase_margin)
        near, valley = np.abs(np.log(np.abs(curves.loop))) <= FAR, valley_samples(distance, curves.index)
        among = among[near[among] | near[among + 1]]
        k, middle = hidden_pieces(loop, curves, slope, valley, among, gain_margin, phase_margin)
        if len(k) == 0:
            break
        curves = _inserted(loop, curves, k, middle)
        added = k + 1 + np.arange(len(k))
        new = Curves(index=curves.index[added], omega=curves.omega[added], loop=curves.loop[added])
        slope = np.insert(slope, k + 1, _log_slope(loop, new))
        among = np.unique(added[:, None] + np.arange(-2, 2))  # the new pieces and those beside them
        among = among[(among >= 0) & (among < len(curves.omega) - 1)]
    return curves


def allowed_chord(distance: Array) -> Array:
    """Return how far apart two samples of a curve may lie in the normalised Nichols plane, by the nearer's distance."""
    return 0.15 + 0.4 * distance


def least_beside(distance: Array) -> Array:
    """Return a distance that a minimum beside a sample does not fall below, given the sample's own."""
    return np.asarray(distance - allowed_chord(distance))


def _divisible(curves: Curves) -> BoolArray:
    """Return which pieces join neighbours on one curve and are longer than the rounding of their frequency."""
    return np.asarray((curves.index[1:] == curves.index[:-1]) & (curves.omega[1:] > curves.omega[:-1] * (1.0 + 1e-9)))


def _steps(loop: Loop, curves: Curves, k: IntArray) -> ComplexArray:
    """Return the change of ln L along the pieces k; the delay's part of the phase is known and never wraps."""
    delay = np.broadcast_to(loop.autopilot.dead_time, loop.batch).reshape(-1)[curves.index[k]]
    turn = delay * (curves.omega[k + 1] - curves.omega[k])
    with np.errstate(divide="ignore", invalid="ignore"):  # between two curves; unused
        return np.asarray(np.log(curves.loop[k + 1] / curves.loop[k] * np.exp(1j * turn)) - 1j * turn)


def _inserted(loop: Loop, curves: Curves, k: IntArray, omega: Array) -> Curves:
    """Return the curves with a sample added in each of the pieces k."""
    owner = curves.index[k]
    value = transfer(loop.take(owner), 1j * omega).loop
    on = ~np.isfinite(value) | (value == 0.0)  # an undamped pole or zero, met exactly: step beside it
    if np.any(on):
        omega = np.where(on, omega + 0.25 * (curves.omega[k + 1] - omega), omega)
        value = transfer(loop.take(owner), 1j * omega).loop
    return Curves(
        index=np.insert(curves.index, k + 1, owner),
        omega=np.insert(curves.omega, k + 1, omega),
        loop=np.insert(curves.loop, k + 1, value),
    )


def _log_slope(loop: Loop, curves: Curves) -> ComplexArray:
    """Return d ln L / d ln omega at the samples."""
    one, s, h = loop.take(curves.index), 1j * curves.omega, 1e-7  # relative; see `margins`
    return np.asarray((transfer(one, s * (1.0 + h)).loop - transfer(one, s * (1.0 - h)).loop) / (2.0 * h * curves.loop))


_T = np.linspace(0.0, 1.0, 13)
# how a cubic rises along a piece, by its whole rise and the slopes at both ends
_CUBIC = np.array([_T**2 * (3.0 - 2.0 * _T), _T * (1.0 - _T) ** 2, -(_T**2) * (1.0 - _T)])


def hidden_pieces(
    loop: Loop,
    curves: Curves,
    slope: ComplexArray,
    valley: BoolArray,
    among: IntArray,
    gain_margin: float,
    phase_margin: float,
) -> tuple[IntArray, Array]:
    """Return the pieces, of those given, in which a minimum of eq 24 or a pair of crossings may hide; where to look.

    Between two samples ln L is followed by the cubic through values and slopes. A piece is split where the cubic turns
    eq 24 round without a sample below both neighbours, nearly does, or comes near 0 dB or -180 deg between ends that
    lie on the same side. slope: d ln L / d ln omega, needed at the ends of those pieces; valley: see `valley_samples`.
    """
    k = among[_divisible(curves)[among]]
    step = _steps(loop, curves, k)
    chord = np.hypot(step.real / np.log(gain_margin), step.imag / phase_margin)
    long = chord > 1e-4
    k, step, chord = k[long], step[long], chord[long]
    ratio = np.log(curves.omega[k + 1] / curves.omega[k])
    terms, start = np.stack([step, slope[k] * ratio, slope[k + 1] * ratio], axis=-1), np.log(-curves.loop[k])
    x = [
        ((part(terms) @ _CUBIC + part(start)[:, None]) / unit)
        for part, unit in ((np.real, np.log(gain_margin)), (np.imag, phase_margin))
    ]
    turn = 2.0 * np.pi / phase_margin
    x[1] -= turn * np.round(x[1][:, 6:7] / turn)  # to the critical point nearest the middle
    squared = x[0] ** 2 + x[1] ** 2
    change = np.diff(squared, axis=-1)
    low = np.argmin(squared, axis=-1)
    seen = valley[k] | valley[k + 1]
    onward = change * np.sign(squared[:, -1:] - squared[:, :1])
    flat = np.min(onward, axis=-1) < 0.5 * np.mean(np.abs(change), axis=-1)
    split = flat & ~seen & (chord > 1e-3)
    split |= (low > 0) & (low < 12) & ~seen
    for part in x:
        same = part[:, 0] * part[:, -1] > 0.0
        split |= same & (np.min(part * np.sign(part[:, :1]), axis=-1) < 0.1 * chord) & (chord > 0.01)
    inner = np.where((low > 0) & (low < 12), low, 6) / 12.0
    where = curves.omega[k] * np.exp(ratio * inner)
    return k[split], where[split]


def valley_samples(distance: Array, index: IntArray) -> BoolArray:
    """Return which samples are not above their neighbours on the same curve."""
    same = index[1:] == index[:-1]
    valley = np.zeros(len(distance), dtype=bool)
    valley[1:-1] = same[1:] & same[:-1] & (distance[1:-1] <= distance[:-2]) & (distance[1:-1] < distance[2:])
    return valley


def placed(loop: Loop) -> tuple[IntArray, Array]:
    """Return first frequencies of each loop of the flattened batch: clusters about its poles and zeros.

    The delay is left out: it has no poles, and it turns the loop evenly, which the halving follows.
    """
    batch = loop.batch
    prompt = replace(loop, autopilot=loop.autopilot.prompt)
    broken, _ = system_matrix(prompt, closed=False)
    closed, _ = system_matrix(prompt)
    features = [np.linalg.eigvals(broken), np.linalg.eigvals(closed), _zeros(loop)]
    p = np.concatenate([np.broadcast_to(f, (*batch, f.shape[-1])).reshape(-1, f.shape[-1]) for f in features], axis=-1)
    size, n = np.abs(p), len(loop.plant.tanks)
    # poles and zeros at the origin place nothing, rounding apart; a stiff actuator does not hide the slow ones
    slow = np.broadcast_to(loop.plant.tank_frequency, (*batch, n)).reshape(-1, n) if n else size
    # with air or guidance nothing at the origin is left, and its poles may be slower still
    least = 1e-7 if loop.plant.velocity_only or loop.plant.guided else 1e-4
    own = np.where(size > least * np.min(slow, axis=-1, keepdims=True, initial=np.inf), size, np.nan)
    low, high = np.nanmin(own, axis=-1), np.nanmax(own, axis=-1)
    low, high = low * 1e-2, _rolled_off(loop, high * 10.0)
    if loop.autopilot.sample_time is not None:
        high = np.minimum(high, np.pi / loop.autopilot.sample_time)  # beyond, a sampler shows the same again
    width = np.maximum(np.abs(p.real), 1e-9 * size)
    steps = 0.7 * 3.0 ** np.arange(20)
    offsets = np.concatenate([-steps, steps])  # never on an undamped pole itself, where L is infinite
    centre = np.where(np.abs(p.imag) > 0.0, np.abs(p.imag), size)
    cluster = centre[..., None] + width[..., None] * offsets
    # a cluster reaches as far as its neighbourhood of half an octave; the background takes over there
    useful = np.abs(cluster - centre[..., None]) < 0.5 * size[..., None]
    cluster = np.where(useful & np.isfinite(own)[..., None] & (p.imag >= 0.0)[..., None], cluster, np.nan)
    background = np.exp(np.linspace(np.log(low), np.log(high), 41, axis=-1))
    omega = np.sort(np.concatenate([cluster.reshape(len(p), -1), background], axis=-1), axis=-1)
    keep = np.isfinite(omega) & (omega >= low[:, None]) & (omega <= high[:, None])
    keep[:, 1:] &= ~(omega[:, 1:] < omega[:, :-1] * (1.0 + 1e-12))
    index = np.broadcast_to(np.arange(len(p))[:, None], omega.shape)
    return index[keep], omega[keep]


def _zeros(loop: Loop) -> ComplexArray:
    """Return the zeros of the plant from engine to what the autopilot is fed, with some spurious ones at the origin.

    A - b c A^r / (c A^(r-1) b) has the zeros and r eigenvalues at the origin; r is 1 with a rate gain, else 2. Where an
    accelerometer feels beta at once by d, A - b c / d has the zeros alone.
    """
    p = fed(loop)
    A, b, c, at_once = p.A, p.B, p.c, p.d
    if np.any(loop.plant.inertial_force):  # the engine's acceleration is the input, its angle and rate are states
        n = A.shape[-1]
        A = np.pad(A, [(0, 0)] * (A.ndim - 2) + [(0, 2), (0, 2)])
        A[..., :n, n], A[..., n, n + 1] = b, 1.0
        b = np.pad(p.B2, [(0, 0)] * (p.B2.ndim - 1) + [(0, 2)])
        b[..., n + 1] = 1.0
        c = np.pad(c, [(0, 0)] * (c.ndim - 1) + [(0, 2)])
        c[..., n], at_once = p.d, p.d2
    c = np.broadcast_to(c, (*loop.batch, A.shape[-1]))
    felt, rated = (np.broadcast_to(x, loop.batch)[..., None] for x in (at_once != 0.0, _rated(loop)))
    c1 = np.einsum("...j,...jk->...k", c, A)
    c2 = np.einsum("...j,...jk->...k", c1, A)
    row = np.where(felt, c, np.where(rated, c1, c2))
    size = np.where(felt[..., 0], at_once, np.where(rated[..., 0], np.sum(c * b, axis=-1), np.sum(c1 * b, axis=-1)))
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = A - b[..., :, None] * row[..., None, :] / size[..., None, None]
    # no zero is placed where the size vanishes
    return np.linalg.eigvals(np.where(np.isfinite(moved), moved, 0.0)).astype(complex)


def _rated(loop: Loop) -> BoolArray:
    """Return whether the autopilot is fed a velocity."""
    a = loop.autopilot
    return np.asarray((np.asarray(a.rate_gain) != 0.0) | (np.asarray(a.drift_rate_gain) != 0.0))


def loop_zeros(loop: Loop) -> ComplexArray:
    """Return the finite zeros of one loop: those of the plant from engine to sensor, and of the forward path.

    Of digital filters those of their bilinear transforms.
    """
    zeros = _zeros(loop)
    order = 0 if np.any(loop.autopilot.accelerometer_gain) else 1 if np.all(_rated(loop)) else 2
    own = zeros[np.argsort(np.abs(zeros))[order:]]
    tops = [f.fraction[0] for f in loop.autopilot.prompt.filter]
    if loop.autopilot.actuator is not None:
        tops.append(loop.autopilot.actuator.fraction[0])
    return np.concatenate([own, *(np.roots(top) for top in tops)]).astype(complex)


def _rolled_off(loop: Loop, omega: Array) -> Array:
    """Return frequencies from `omega` on, doubled until the loop gain is below -40 dB."""
    index = np.arange(len(omega))
    for _ in range(20):
        loud = np.abs(transfer(loop.take(index), 1j * omega).loop) > 0.01
        if not np.any(loud):
            break
        omega = np.where(loud, 2.0 * omega, omega)
    return omega
