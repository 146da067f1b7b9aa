"""The forward path as a chain of state-space blocks, for eigenvalues and for the time domain."""

import math
from dataclasses import dataclass

import numpy as np

from sloshpy.autopilot.autopilot import Actuator, Autopilot, Filter
from sloshpy.units import Array, ComplexArray

LEAST_DELAY = 1e-5  # s, of the approximation only: the exact delay is what poles are polished on
PADE_ORDER = 8  # orders 1 to 4 give wrong verdicts with bending modes; from 6 on none was found


@dataclass(frozen=True, kw_only=True)
class Block:
    """A single-input single-output system x' = A x + B u, y = C x + D u, one kind of states."""

    kind: str  # "filter", "delay" or "actuator"
    A: Array  # (..., k, k)
    B: Array  # (..., k)
    C: Array  # (..., k)
    D: Array  # (...)


def filter_block(filter_: Filter) -> Block:
    """Return a filter as integrators that all run at its own frequency, see `rational_block`."""
    return rational_block("filter", *filter_.fraction)


def actuator_block(actuator: Actuator) -> Block:
    """Return an actuator without its limits; one of the second order has angle and rate for states."""
    if actuator.frequency is None:
        return rational_block("actuator", *actuator.fraction)
    (square,), (_, lag, _) = actuator.fraction
    zero, one = np.zeros_like(square), np.ones_like(square)
    A = np.stack([np.stack([zero, one], axis=-1), np.stack([-square, -lag], axis=-1)], axis=-2)
    return Block(
        kind="actuator",
        A=A,
        B=np.stack([zero, square], axis=-1),
        C=np.stack([one, zero], axis=-1),
        D=zero,
    )


def rational_block(kind: str, numerator: Array, denominator: Array) -> Block:
    """Return fractions (k, ...) in the controllable canonical form of s/w: x' = w (A x + B u), y = C x + D u.

    w = |a_n / a_0|^(1/n) of the denominator a_0 s^n + ... + a_n, the mean frequency of its poles (of those not at the
    origin), so that the entries are of one size. Where coefficients move with time this is the realisation meant: a
    lag is tau y' = u - y, and a filter whose frequency alone moves is a fixed one on a clock that runs at w(t).
    """
    b, a = numerator / denominator[0], denominator / denominator[0]
    k, batch = len(a) - 1, a.shape[1:]
    b = np.concatenate([np.zeros((len(a) - len(b), *batch)), b])
    w = np.zeros(batch)
    for i in range(k, 0, -1):
        w = np.where(w == 0.0, np.abs(a[i]) ** (1.0 / i), w)
    w = np.where(w == 0.0, 1.0, w)
    scale = w ** -np.arange(k + 1.0).reshape(-1, *[1] * len(batch))
    b, a = np.moveaxis(b * scale, 0, -1), np.moveaxis(a * scale, 0, -1)  # in s/w
    A = np.zeros((*batch, k, k))
    if k:
        A[..., 0, :], A[..., 1:, :-1] = -a[..., 1:], np.eye(k - 1)
    return Block(
        kind=kind,
        A=w[..., None, None] * A,
        B=w[..., None] * (np.eye(k)[:, 0] if k else np.zeros(0)),
        C=b[..., 1:] - b[..., :1] * a[..., 1:],
        D=b[..., 0],
    )


def delay_block(delay: Array, order: int = PADE_ORDER) -> Block:
    """Return the diagonal Pade approximation of a delay in s, shape (...), as a cascade of all-pass sections.

    A cascade of second-order sections keeps its accuracy where one polynomial's coefficients spread over ten decades.
    """
    poles = np.roots(_pade(order)[::-1])  # of the denominator; the numerator's are their mirror images
    poles = poles[poles.imag > 0.0]
    A, B, C = np.zeros((order, order)), np.zeros(order), np.zeros(order)
    D = 1.0
    for i, p in enumerate(poles):
        a1, a0 = -2.0 * p.real, abs(p) ** 2  # (x^2 - a1 x + a0) / (x^2 + a1 x + a0) = 1 - 2 a1 x / (...)
        rows = slice(2 * i, 2 * i + 2)
        a, b, c = np.array([[0.0, 1.0], [-a0, -a1]]), np.array([0.0, 1.0]), np.array([0.0, -2.0 * a1])
        A[rows, : 2 * i], A[rows, rows], B[rows] = np.outer(b, C[: 2 * i]), a, b * D
        C[rows] = c
    rate = 1.0 / np.asarray(delay, dtype=float)[..., None]
    return Block(
        kind="delay",
        A=rate[..., None] * A,
        B=rate * B,
        C=np.broadcast_to(C, (*rate.shape[:-1], order)),
        D=np.ones(rate.shape[:-1]),
    )


def _pade(order: int) -> list[float]:
    """Return the coefficients of the diagonal approximation's denominator in rising powers of s tau."""
    return [math.comb(order, k) * math.factorial(2 * order - k) / math.factorial(order) for k in range(order + 1)]


def delay_error(delay: Array, s: ComplexArray, parts: int, order: int = PADE_ORDER) -> Array:
    """Return |e(s) exp(s tau) - 1| of the delay e(s) that `series_blocks` takes for exp(-s tau)."""
    x = s * np.maximum(delay, LEAST_DELAY) / parts
    bottom = np.array(_pade(order))[::-1]
    top = bottom * (-1.0) ** np.arange(order, -1, -1)
    with np.errstate(all="ignore"):  # far from the origin nothing is left of either: infinite, or no number
        error = np.abs((np.polyval(top, x) / np.polyval(bottom, x)) ** parts * np.exp(s * delay) - 1.0)
    return np.where(np.isfinite(error), error, np.inf)


def series_blocks(autopilot: Autopilot, delay_parts: int = 1, order: int = PADE_ORDER) -> list[Block]:
    """Return the blocks from the gain's output to the engine angle in signal order; a zero delay is no block.

    Of a digital autopilot approximations: its filters bilinear, its hold as half a period of delay.

    The delay is a chain of so many equal parts, each approximated: the longer the chain, the higher the frequency to
    which it holds (about 8 radians for each part of order 8).
    """
    blocks = [filter_block(f) for f in autopilot.prompt.filter]
    if np.any(np.asarray(autopilot.dead_time) > 0.0):
        # a batch may hold zero delays: a start is wanted there too, and entries that leave the eigenvalues their digits
        blocks += delay_parts * [delay_block(np.maximum(autopilot.dead_time, LEAST_DELAY) / delay_parts, order)]
    if autopilot.actuator is not None:
        blocks.append(actuator_block(autopilot.actuator))
    return blocks
