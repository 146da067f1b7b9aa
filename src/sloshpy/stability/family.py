"""One loop at many dampings of its tanks, sampled on common frequencies: the plant is solved once for all dampings."""

from collections.abc import Callable

import numpy as np

from sloshpy.autopilot import forward_transfer
from sloshpy.case import Criteria
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.partial_fractions import references_on
from sloshpy.dynamics.response import REFERENCE_DAMPING, closed_by_damping
from sloshpy.stability.nichols import (
    Curves,
    allowed_chord,
    hidden_pieces,
    least_beside,
    nichols_disc_margin,
    placed,
    valley_samples,
)
from sloshpy.units import Array, ComplexArray, IntArray

LEAST = 1e-5  # damping ratio; in each decade above it one loop's poles and zeros place the first frequencies


def sampled_family(batch: Loop, moved: tuple[int, ...], criteria: Criteria, below: float) -> Curves:
    """Sample loops that differ in their damping alone so densely that no minimum of eq 24 below a level is missed.

    By the rules of `nichols.sampled`, on frequencies common to all of them.

    Args:
        batch: of one axis, damping increasing.
        moved: numbers of the tanks whose damping may differ.
        criteria: gain and phase margin of eq 24.
        below: minima above this may be missed.
    """
    GM, PM = criteria.gain_margin, criteria.phase_margin
    one, tanks = batch.take(np.asarray(0)), np.array(moved)
    ratio = np.broadcast_to(batch.damping, (*batch.batch, batch.damping.shape[-1]))
    decades = np.max(np.ptp(np.log10(np.maximum(ratio[:, tanks], LEAST)), axis=0))
    anchors = np.unique(np.linspace(0, len(ratio) - 1, int(np.ceil(decades)) + 2).astype(int))
    omega = np.unique(placed(batch.take(anchors))[1])
    omega = omega[np.append(True, np.diff(omega) > 1e-9 * omega[:-1])]
    reference_ratio = one.damping.copy()
    reference_ratio[tanks] = REFERENCE_DAMPING
    (reference,) = references_on(batch.take(np.array([0])), omega, reference_ratio)
    d = 2.0 * (ratio[:, tanks] - REFERENCE_DAMPING) * one.plant.tank_frequency[tanks]

    def response(at: Array) -> ComplexArray:
        s = 1j * at
        y_b, Y_a, z_b, Z_a = (np.moveaxis(x, -1, 0) for x in reference(at))
        Z_a = Z_a[:, tanks[:, None], tanks]
        y = closed_by_damping(s[:, None] * d[:, None, :], (y_b, Y_a[:, tanks], z_b[:, tanks], Z_a))[0]
        return np.asarray(-forward_transfer(one.autopilot, s) * y)

    L = response(omega)
    sound = np.all(np.isfinite(L) & (L != 0.0), axis=0)
    omega, L = omega[sound], L[:, sound]
    tau = float(one.autopilot.dead_time)
    among: IntArray = np.arange(len(omega) - 1)
    for _ in range(40):
        turn = tau * (omega[among + 1] - omega[among])
        step = np.log(L[:, among + 1] / L[:, among] * np.exp(1j * turn)) - 1j * turn
        chord = np.hypot(step.real / np.log(GM), step.imag / PM)
        distance = nichols_disc_margin(L[:, [among, among + 1]], GM, PM)
        long = np.any(chord > allowed_chord(np.min(distance, axis=1)), axis=0)
        split = among[long & (omega[among + 1] > omega[among] * (1.0 + 1e-9))]
        if len(split) == 0:
            break
        omega, L, among = _inserted(omega, L, split, np.sqrt(omega[split] * omega[split + 1]), response)
    return _searched(batch, omega, L, response, criteria, below)


def _searched(
    batch: Loop,
    omega: Array,
    L: ComplexArray,
    response: Callable[[Array], ComplexArray],
    criteria: Criteria,
    below: float,
) -> Curves:
    """Return the curves with samples added wherever a minimum below the level may hide."""
    GM, PM, h = criteria.gain_margin, criteria.phase_margin, 1e-7
    slope = np.full(L.shape, np.nan, dtype=complex)
    among: IntArray = np.arange(len(omega) - 1)
    for _ in range(16):
        unknown = np.flatnonzero(np.isnan(slope[0].real))
        at = omega[unknown]
        above, beneath = np.split(response(np.concatenate([at * (1.0 + h), at * (1.0 - h)])), 2, axis=1)
        slope[:, unknown] = (above - beneath) / (2.0 * h * L[:, unknown])
        distance = nichols_disc_margin(L, GM, PM)
        near = least_beside(distance) <= below
        level, piece = np.nonzero(near[:, among] | near[:, among + 1])
        F, curves = len(omega), _flattened(omega, L)
        valley = valley_samples(distance.ravel(), curves.index)
        k, where = hidden_pieces(batch, curves, slope.ravel(), valley, level * F + among[piece], GM, PM)
        if len(k) == 0:
            return curves
        where, first = np.unique(where, return_index=True)
        omega, L, among = _inserted(omega, L, k[first] % F, where, response)
        grown = np.full(L.shape, np.nan, dtype=complex)
        grown[:, np.isin(omega, where, invert=True)] = slope
        slope = grown
    return _flattened(omega, L)


def _inserted(
    omega: Array, L: ComplexArray, k: IntArray, at: Array, response: Callable[[Array], ComplexArray]
) -> tuple[Array, ComplexArray, IntArray]:
    """Return frequencies and curves with samples added in the pieces k, and the pieces that are new or beside one."""
    value = response(at)
    on = ~np.all(np.isfinite(value) & (value != 0.0), axis=0)  # an undamped pole or zero, met exactly: step beside it
    if np.any(on):
        at = np.where(on, at + 0.25 * (omega[k + 1] - at), at)
        value = response(at)
    added = k + 1 + np.arange(len(k))
    omega, L = np.insert(omega, k + 1, at), np.insert(L, k + 1, value, axis=1)
    among = np.unique(added[:, None] + np.arange(-2, 2))
    return omega, L, among[(among >= 0) & (among < len(omega) - 1)]


def _flattened(omega: Array, L: ComplexArray) -> Curves:
    index = np.repeat(np.arange(len(L)), len(omega))
    return Curves(index=index, omega=np.tile(omega, len(L)), loop=L.ravel())
