"""Floquet multipliers of a periodic orbit: what a small disturbance has become after one period.

Along the orbit a damper's slope u'(v(t)) repeats itself after half a period, since every law is odd. A disturbance

    dv(t) = exp(mu t) sum_k c_k exp(2 j k W t)   obeys   c_k = G(mu + 2 j k W) sum_m (P_2(k-m) + d delta_km) c_m

with P the Fourier coefficients of the slope and G the closed loop's mobility (see `harmonic_balance`), delay exact.
Roots mu of this determinant (Hill's) are started from a finite model, where the delay is a Pade approximation, and
polished by Newton's method; the multipliers are exp(mu T). One of them is 1, the orbit shifted in time.

The witness is a count of the roots in the right half of one strip of height 2 W by the winding of the determinant:
no start and no approximation of the delay has part in it.
"""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.dynamics.poles import unstable_count
from sloshpy.dynamics.states import system_matrix
from sloshpy.limit_cycle.harmonic_balance import Balance, mobility, slopes, velocities
from sloshpy.units import Array, ComplexArray

LEAST = 1e-6  # a multiplier smaller than this is left out: such a disturbance is gone within the period
PARTS = 64  # of half a period, in the finite model that starts the search
MOST_PAIRS = 32  # of harmonics on either side of a disturbance's own frequency
WITNESS_PAIRS = 12
NEUTRAL = 1e-7  # a multiplier nearer than this to the unit circle decides nothing
LINE = 1e-5  # of the orbit's frequency: growth from which the witness counts, clear of the shift in time
ROUNDING = 1e-14  # of Hill's matrix, which is near the identity
FINE = 2**16  # samples of one period: the slope of a law has kinks, and its aliasing is the error of the multipliers


@dataclass(frozen=True, kw_only=True)
class Floquet:
    """Multipliers of a periodic orbit, the largest first.

    multiplier: (F,), without the trivial one; those below 1e-6 are left out. omega: (F,), rad/s, the frequency at which
    each disturbance is largest. trivial: the multiplier of a shift in time, 1 but for what the harmonics left out.
    error: relative, of the two largest multipliers, by halving the harmonics.
    unstable: multipliers beyond the unit circle, by the winding of Hill's determinant.
    """

    multiplier: ComplexArray
    omega: Array
    trivial: complex
    error: float
    unstable: int

    @property
    def stable(self) -> bool | None:
        """Whether every disturbance dies out; None where one is neutral or where multipliers and winding disagree."""
        size = np.abs(self.multiplier)
        counted = int(np.sum(size > np.exp(2.0 * np.pi * LINE)))
        if np.any(np.abs(size - 1.0) < max(NEUTRAL, self.error)) or counted != self.unstable:
            return None
        return bool(np.all(size < 1.0))


def floquet(b: Balance, V: ComplexArray, omega: float) -> Floquet:
    """Return the Floquet multipliers of the orbit with velocity harmonics V (n_tanks, K) and frequency omega."""
    pairs = min(MOST_PAIRS, max(8, len(b.number)))
    hill, coarse = _hill(b, V, omega, pairs), _hill(b, V, omega, pairs // 2)
    half = np.pi / omega
    found: list[complex] = []
    for sigma in _starts(b, V, omega):
        mu = hill.polished(complex(np.log(sigma)) / half)
        if not np.isnan(mu) and abs(np.exp(mu * 2.0 * half)) > LEAST and not any(_same(mu, x, omega) for x in found):
            found.append(mu)
    exponent = np.array(found, dtype=complex)
    shift = int(np.argmin(np.abs(np.exp(exponent * half) + 1.0)))  # the orbit itself changes sign over half a period
    others = np.delete(exponent, shift)
    others = others[np.argsort(-others.real, kind="stable")]
    leading = others[:2]
    again = np.array([coarse.polished(complex(mu)) for mu in leading])
    change = np.abs(np.exp((again - leading) * 2.0 * half) - 1.0)
    return Floquet(
        multiplier=np.exp(others * 2.0 * half),
        omega=np.array([hill.loudest(complex(mu)) for mu in others]),
        trivial=complex(np.exp(exponent[shift] * 2.0 * half)),
        error=float(np.max(change, initial=0.0)),
        unstable=_hill(b, V, omega, min(WITNESS_PAIRS, pairs)).right_half(),
    )


@dataclass(frozen=True, kw_only=True)
class _Hill:
    """Hill's determinant with harmonics -pairs..pairs of twice the orbit's frequency.

    coupling: (2 pairs + 1, 2 pairs + 1, n_tanks), 1/s: P_2(k-m) + d delta_km.
    """

    b: Balance
    omega: float
    coupling: ComplexArray

    @property
    def offset(self) -> ComplexArray:
        """2 j k W of each harmonic."""
        pairs = len(self.coupling) // 2
        return 2j * self.omega * np.arange(-pairs, pairs + 1)

    def matrix(self, mu: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return H, dH/dmu and, of each harmonic, the log derivative of what clears G of its poles; mu of any shape."""
        G, dG, trace = mobility(self.b.loop, np.asarray(mu)[..., None] + self.offset)
        count, n = len(self.offset), G.shape[-1]
        size = (*np.shape(mu), count * n, count * n)
        H = np.eye(count * n) - np.einsum("...kij,kmj->...kimj", G, self.coupling).reshape(size)
        return H, -np.einsum("...kij,kmj->...kimj", dG, self.coupling).reshape(size), trace

    def polished(self, mu: complex) -> complex:
        """Return the root near mu; nan where Newton's method does not converge."""
        size = np.inf
        for _ in range(30):
            try:
                H, dH, trace = self.matrix(np.array(mu))
                step = 1.0 / complex(np.trace(np.linalg.solve(H, dH)) + np.sum(trace))
            except np.linalg.LinAlgError:  # exactly on a root, of H or of what it is cleared by
                return mu
            if not np.isfinite(step):
                return complex(np.nan, np.nan)
            size = abs(step) / self.omega
            mu -= step * min(1.0, 0.1 / size) if size > 0.0 else 0.0
            if size < 1e-13:
                break
        if size > 1e-9:
            return complex(np.nan, np.nan)
        return mu - 2j * self.omega * round(mu.imag / (2.0 * self.omega))

    def loudest(self, mu: complex) -> float:
        """Return the frequency of the largest component of a root's disturbance, rad/s."""
        H = self.matrix(np.array(mu))[0]
        H = H + ROUNDING * np.eye(len(H))  # else a root met exactly leaves nothing to divide by
        vector = np.ones(len(H), dtype=complex)
        for _ in range(3):  # inverse iteration: the singular direction of H, a hundredth of the time of its svd
            vector = np.linalg.solve(H, vector)
            vector /= np.linalg.norm(vector)
        k = int(np.argmax(np.linalg.norm(vector.reshape(len(self.offset), -1), axis=-1)))
        return abs(float((mu + self.offset[k]).imag))

    def right_half(self) -> int:
        """Count the roots in the right half of a strip of height 2 W: those of the reference loop plus the winding.

        The path runs a little to the right of the imaginary axis, past the root of the shift in time.
        """
        W = self.omega
        nu = np.linspace(-W, W, 65)
        sign, rate = self._along(LINE * W + 1j * nu)
        for _ in range(40):
            # two roots, or a root and a pole, close together hide in the direction but not in the derivatives
            wide = np.flatnonzero(np.diff(nu) * np.maximum(rate[1:], rate[:-1]) > 1.0)
            if len(wide) == 0:
                break
            middle = 0.5 * (nu[wide] + nu[wide + 1])
            new_sign, new_rate = self._along(LINE * W + 1j * middle)
            nu, sign = np.insert(nu, wide + 1, middle), np.insert(sign, wide + 1, new_sign)
            rate = np.insert(rate, wide + 1, new_rate)
        turns = float(np.sum(np.angle(sign[1:] / sign[:-1]))) / (2.0 * np.pi)
        return unstable_count(self.b.loop) - round(turns)

    def _along(self, mu: ComplexArray) -> tuple[ComplexArray, Array]:
        """Return the direction of det H at points mu, and how near roots of H and poles of G are, 1/distance."""
        sign, rate = np.zeros(len(mu), dtype=complex), np.zeros(len(mu))
        for i, x in enumerate(mu):
            H, dH, trace = self.matrix(x)
            sign[i] = np.linalg.slogdet(H)[0]
            rate[i] = max(abs(np.trace(np.linalg.solve(H, dH))), float(np.max(np.abs(trace))))
        return sign, rate


def _hill(b: Balance, V: ComplexArray, omega: float, pairs: int) -> _Hill:
    P = np.fft.fft(slopes(b, velocities(b, V, FINE)), axis=-1) / FINE
    k = np.arange(2 * pairs + 1)
    coupling = P[:, 2 * (k[:, None] - k[None, :]) % FINE] + b.relief[:, None, None] * np.eye(2 * pairs + 1)
    return _Hill(b=b, omega=omega, coupling=np.moveaxis(coupling, 0, -1))


def _same(one: complex, other: complex, omega: float) -> bool:
    apart = (one - other) / (2.0 * omega)
    return abs(apart - 1j * round(apart.imag)) < 1e-9


def _starts(b: Balance, V: ComplexArray, omega: float) -> ComplexArray:
    """Return the multipliers over half a period of the finite model, the largest first.

    By Magnus' method of fourth order without commutators, two exponentials for each part of the half period.
    """
    from scipy.linalg import expm  # 0.3 s: only for an orbit

    p = b.loop.plant
    A, _ = system_matrix(replace(b.loop, damping=np.zeros_like(b.loop.damping)))
    coordinates = p.mass.shape[-1]
    first = coordinates - int(p.velocity_only)  # where the velocities start
    push = np.linalg.inv(p.mass)[:, p.slosh] * p.tank_mass
    nodes = (np.arange(PARTS)[:, None] + 0.5 + np.array([-1.0, 1.0]) * np.sqrt(3.0) / 6.0).ravel() * np.pi / PARTS
    wave = np.exp(1j * np.outer(b.number, nodes))
    slope = slopes(b, np.asarray((V @ wave).real))
    At = np.broadcast_to(A, (len(nodes), *A.shape)).copy()
    for j in range(len(p.tanks)):
        rows, column = slice(first, first + coordinates), first + p.first_tank + j
        At[:, rows, column] += slope[j][:, None] * push[:, j]
    one, two = At[0::2], At[1::2]
    near, far = 0.25 + np.sqrt(3.0) / 6.0, 0.25 - np.sqrt(3.0) / 6.0
    h = np.pi / omega / PARTS
    steps = expm(h * (far * one + near * two)) @ expm(h * (near * one + far * two))
    whole = np.eye(len(A))
    for step in steps:
        whole = step @ whole
    sigma = np.linalg.eigvals(whole).astype(complex)
    sigma = sigma[np.abs(sigma) ** 2 > LEAST]
    return np.asarray(sigma[np.argsort(-np.abs(sigma), kind="stable")])
