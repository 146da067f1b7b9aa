"""Harmonics of the slosh velocities that balance the nonlinear dampers against everything linear, exactly.

With every tank at a reference damping, what remains of its damper is an acceleration e_j = u_j(v_j) + d_j v_j on the
slosh mass, and plant, autopilot and delay are one small matrix at each frequency, the closed loop's mobility G(s):

    v_j(t) = Re sum_k V_jk exp(j k W t) ,   V_k = G(j k W) (U_k(v) + d V_k) ,   k = 1, 3, 5, ...

Only odd k: every law is odd, so the motion repeats itself with the other sign after half a period. U_k are the Fourier
coefficients of the damper's acceleration over one period (alternating frequency and time).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sloshpy.damping import DampingLaw
from sloshpy.dynamics.characteristic import characteristic_matrix
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import REFERENCE_DAMPING, excess_damping
from sloshpy.errors import OutsideValidity
from sloshpy.units import Array, ComplexArray, IntArray

SAMPLES = 32  # of one period for each harmonic kept: aliasing lies below what the harmonics left out do
LEAST_SAMPLES = 2048
LEAVES = "the exact motion leaves the damping data that the one-sinusoid cycle stays within"
STENCIL = 1e-5  # of the velocity amplitude, for the slope of a law; a kink is smeared over no more than this


@dataclass(frozen=True, kw_only=True)
class Balance:
    """What is balanced: the loop with every tank at the reference damping, the laws, the harmonics kept.

    number: (K,), odd, increasing from 1.
    """

    loop: Loop
    laws: tuple[DampingLaw, ...]
    number: IntArray

    @property
    def samples(self) -> int:
        """Samples of one period, a power of two."""
        return max(LEAST_SAMPLES, 1 << (SAMPLES * len(self.number) - 1).bit_length())

    @property
    def relief(self) -> Array:
        """d_j in 1/s, what the reference damping takes from each damper, (n_tanks,)."""
        return -excess_damping(replace(self.loop, damping=np.zeros_like(self.loop.damping)))


def balance(loop: Loop, laws: Sequence[DampingLaw], harmonics: int) -> Balance:
    """Return the balance of a loop with so many odd harmonics."""
    reference = replace(loop, damping=np.full_like(loop.damping, REFERENCE_DAMPING))
    return Balance(loop=reference, laws=tuple(laws), number=2 * np.arange(harmonics) + 1)


def motion(loop: Loop, s: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return what the closed loop does under a unit acceleration on each slosh mass at complex frequencies s (...).

    Returns:
        x: coordinates q and engine angle, (..., n + 1, n_tanks); where Z enters by its velocity alone, Z' is the first.
        dx/ds. d(ln det T)/ds, (...), of the characteristic matrix T of `poles`.
    """
    T, dT = characteristic_matrix(loop, s)
    p = loop.plant
    n_tanks = len(p.tanks)
    push = np.zeros((T.shape[-1], n_tanks))
    push[np.arange(n_tanks) + p.first_tank, np.arange(n_tanks)] = p.tank_mass
    inverse = np.linalg.inv(T)
    turned = inverse @ dT
    x = inverse @ push
    return x, -turned @ x, np.trace(turned, axis1=-2, axis2=-1)


def mobility(loop: Loop, s: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return G(s), slosh velocities under a unit acceleration on each slosh mass, (..., n_tanks, n_tanks).

    Returns:
        G in s, dG/ds, and d(ln det T)/ds as of `motion`.
    """
    s = np.asarray(s, dtype=complex)
    x, dx, trace = motion(loop, s)
    z, dz, S = x[..., loop.plant.slosh, :], dx[..., loop.plant.slosh, :], s[..., None, None]
    return S * z, z + S * dz, trace


def velocities(b: Balance, V: ComplexArray, samples: int) -> Array:
    """Return the slosh velocities over one period, (n_tanks, samples), m/s."""
    spectrum = np.zeros((len(V), samples // 2 + 1), dtype=complex)
    spectrum[:, b.number] = V * (samples / 2)
    return np.fft.irfft(spectrum, samples, axis=-1)


def accelerations(b: Balance, v: Array) -> Array:
    """Return each damper's acceleration at slosh velocities (n_tanks, ...); nan beyond a law's data."""
    w = b.loop.plant.tank_frequency
    return np.stack([law.acceleration(v[j], float(w[j])) for j, law in enumerate(b.laws)])


def slopes(b: Balance, v: Array) -> Array:
    """Return du/dv of each damper at slosh velocities over one period, (n_tanks, samples), 1/s."""
    step = STENCIL * np.max(np.abs(v), axis=-1, keepdims=True)
    w = b.loop.plant.tank_frequency
    end = np.array([law.largest_amplitude for law in b.laws])[:, None] * w[:, None]
    above, below = np.minimum(v + step, end), np.maximum(v - step, -end)
    width = above - below
    # a tank at rest has no width; the slope there is that of rest
    still = width == 0.0
    above, below = np.where(still, 1e-9, above), np.where(still, -1e-9, below)
    return np.asarray((accelerations(b, above) - accelerations(b, below)) / (above - below))


def residual(b: Balance, V: ComplexArray, omega: float) -> ComplexArray:
    """Return V_k - G (U_k + d V_k), m/s, (n_tanks, K): zero on a periodic orbit."""
    v = velocities(b, V, b.samples)
    U = np.fft.rfft(accelerations(b, v), axis=-1)[:, b.number] * (2.0 / b.samples)
    G, _, _ = mobility(b.loop, 1j * omega * b.number)
    return np.asarray(V - np.einsum("kij,jk->ik", G, U + b.relief[:, None] * V))


def solve(b: Balance, V: ComplexArray, omega: float, leader: int) -> tuple[ComplexArray, float]:
    """Return the harmonics (n_tanks, K) and the frequency that balance, from a start, by Newton's method.

    Args:
        leader: tank whose fundamental keeps its phase, 0.

    Raises:
        OutsideValidity: Newton's method does not converge, or it leaves a law's data.
    """
    scale = float(abs(V[leader, 0]))
    V = V * np.exp(-1j * np.outer(np.ones(len(V)), b.number) * np.angle(V[leader, 0]))
    error, least = np.inf, np.inf
    for _ in range(60):
        R = residual(b, V, omega)
        error = float(np.max(np.abs(R))) / scale
        if not np.isfinite(error):
            raise OutsideValidity(LEAVES)
        if error < 1e-14 or (error < 1e-11 and error > 0.5 * least):
            return V, omega
        least = min(least, error)
        step, turn = _step(b, V, omega, leader, R)
        part = 1.0
        leaves = np.isnan(_norm(b, V + step, omega + turn))
        while part > 1e-3 and not _norm(b, V + part * step, omega + part * turn) < (1.0 - 1e-4 * part) * _size(R):
            part *= 0.5
        if part <= 1e-3:
            if error < 1e-10:
                return V, omega
            if leaves:
                raise OutsideValidity(LEAVES)
            break
        V, omega = V + part * step, omega + part * turn
        if abs(V[leader, 0]) < 1e-3 * scale:
            break
    raise OutsideValidity(f"no periodic motion was found near the one-sinusoid cycle (residual {error:.1e})")


def _size(R: ComplexArray) -> float:
    return float(np.sqrt(np.sum(np.abs(R) ** 2)))


def _norm(b: Balance, V: ComplexArray, omega: float) -> float:
    return _size(residual(b, V, omega)) if omega > 0.0 else np.inf


def _step(b: Balance, V: ComplexArray, omega: float, leader: int, R: ComplexArray) -> tuple[ComplexArray, float]:
    """Return the Newton step of harmonics and frequency.

    du = u'(v) dv has the coefficients dU_k = sum_m P_(k-m) dV_m + P_(k+m) conj(dV_m), P those of u'(v(t)).
    """
    n, K, k = len(V), len(b.number), b.number
    v = velocities(b, V, b.samples)
    P = np.fft.fft(slopes(b, v), axis=-1) / b.samples
    G, dG, _ = mobility(b.loop, 1j * omega * k)
    U = np.fft.rfft(accelerations(b, v), axis=-1)[:, k] * (2.0 / b.samples)
    straight = P[:, (k[:, None] - k[None, :]) % b.samples] + b.relief[:, None, None] * np.eye(K)
    mirrored = P[:, (k[:, None] + k[None, :]) % b.samples]
    A = np.eye(n * K) - np.einsum("kij,jkm->ikjm", G, straight).reshape(n * K, n * K)
    B = -np.einsum("kij,jkm->ikjm", G, mirrored).reshape(n * K, n * K)
    by_omega = -np.einsum("kij,jk->ik", 1j * k[:, None, None] * dG, U + b.relief[:, None] * V).ravel()
    size = 2 * n * K
    J, right = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
    J[:size, :size] = np.block([[A.real + B.real, B.imag - A.imag], [A.imag + B.imag, A.real - B.real]])
    J[:size, size] = np.concatenate([by_omega.real, by_omega.imag])
    J[size, n * K + leader * K] = 1.0  # the leader's fundamental stays real
    right[:size] = -np.concatenate([R.real.ravel(), R.imag.ravel()])
    step = np.linalg.solve(J, right)
    return (step[: n * K] + 1j * step[n * K : size]).reshape(n, K), float(step[size])
