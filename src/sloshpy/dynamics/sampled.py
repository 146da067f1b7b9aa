"""The sampled loop without approximation: from one sample to the next by the matrix exponential.

    sensors, analogue filters --> sampler --> gain, digital filters --> v_n --> hold, delay --> actuator, plant
                                                                    ^ broken here

`response` takes of the sampler its gain alone and leaves out what it folds into the loop from above half the sampling
frequency. Here nothing is left out, for one loop: its poles in z are the witness of every verdict, and its frequency
response says what the folding is worth.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.autopilot.blocks import actuator_block, filter_block
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.sensed import fed
from sloshpy.units import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class SampledLoop:
    """x_{n+1} = A x_n + B v_n, w_n = C x_n from the command v to what the digital filters are to give, without sign.

    A: (N, N), B: (N,), C: (N,): plant, analogue filters, actuator, commands under way, digital filters.
    sample_time: s.
    """

    A: Array
    B: Array
    C: Array
    sample_time: float

    @property
    def poles(self) -> ComplexArray:
        """Poles of the closed loop in z; those inside the unit circle die out."""
        return np.linalg.eigvals(self.A + np.outer(self.B, self.C)).astype(complex)

    @property
    def growth(self) -> float:
        """Greatest growth rate of the closed loop, ln |z| / T, 1/s."""
        return float(np.log(np.max(np.abs(self.poles))) / self.sample_time)

    def loop(self, omega: Array) -> ComplexArray:
        """Return L(e^{j omega T}) = -w/v at frequencies in rad/s."""
        z = np.exp(1j * np.asarray(omega, dtype=float) * self.sample_time)
        resolvent = z[..., None, None] * np.eye(len(self.A)) - self.A
        right = np.broadcast_to(self.B[:, None], (*z.shape, len(self.B), 1)).astype(complex)
        return np.asarray(-(np.linalg.solve(resolvent, right)[..., 0] @ self.C))


def sampled_loop(loop: Loop) -> SampledLoop:
    """Return the sampled loop of one digital loop, no batch.

    Raises:
        ValueError: the autopilot is not digital.
    """
    from scipy.linalg import expm  # 0.2 s: only for a digital autopilot

    pilot = loop.autopilot
    if pilot.sample_time is None:
        raise ValueError("the autopilot is continuous: it has no sample_time")
    T = pilot.sample_time
    A, b, c, d = _analogue(loop)
    n = len(A)
    whole, part = divmod(float(pilot.delay), T)
    part = 0.0 if part < 1e-12 * T else part
    # over a period the older command acts for `part`, then the newer one
    moved = [expm(np.block([[A * t, b[:, None] * t], [np.zeros((1, n + 1))]])) for t in (part, T - part)]
    first, second = moved
    step = second[:n, :n] @ first[:n, :n]
    older, newer = second[:n, :n] @ first[:n, n], second[:n, n]
    waiting = int(whole) + 1  # commands v_{n-1} ... kept; the oldest is what acts just before a sample
    size = n + waiting
    F, G, H = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    F[:n, :n] = step
    F[:n, size - 1] += older
    if whole >= 1:
        F[:n, size - 2] += newer
    else:
        G[:n] += newer
    G[n] = 1.0
    F[n + 1 :, n : size - 1] = np.eye(waiting - 1)
    H[:n], H[size - 1] = c, d
    return _with_digital_filters(loop, F, G, H)


def _analogue(loop: Loop) -> tuple[Array, Array, Array, float]:
    """Return plant, analogue filters and actuator as one system from the held command to what is sampled."""
    p, pilot = fed(loop), loop.autopilot
    A, b, c, d = p.A, p.B, p.c, float(p.d)
    if pilot.actuator is not None:
        a = actuator_block(pilot.actuator)
        n, k = len(A), len(a.B)
        CA = a.C @ a.A  # beta' = C A x, beta'' = C A^2 x + C A B u: two orders below where the engine has inertia
        inertia = np.any(p.B2) or p.d2 != 0.0
        beta2, beta2_at_once = (CA @ a.A, float(CA @ a.B)) if inertia else (np.zeros(k), 0.0)
        A = np.block(
            [[A, np.outer(b, a.C) + np.outer(p.B2, beta2)], [np.zeros((k, n)), a.A]],
        )
        c = np.concatenate([c, d * a.C + float(p.d2) * beta2])
        b = np.concatenate([b * float(a.D) + p.B2 * beta2_at_once, a.B])
        d = d * float(a.D) + float(p.d2) * beta2_at_once
    for f in pilot.filter:
        block = filter_block(f)
        n, k = len(A), len(block.B)
        A = np.block([[A, np.zeros((n, k))], [np.outer(block.B, c), block.A]])
        b = np.concatenate([b, block.B * d])
        c, d = np.concatenate([float(block.D) * c, block.C]), float(block.D) * d
    return A, b, c, d


def _with_digital_filters(loop: Loop, F: Array, G: Array, H: Array) -> SampledLoop:
    """Return the sampled loop with gain and digital filters after what is sampled."""
    pilot = loop.autopilot
    H = float(pilot.gain) * H
    for f in pilot.digital_filter:
        bottom = np.array(f.denominator)
        top = np.concatenate([np.zeros(len(bottom) - len(f.numerator)), f.numerator]) / bottom[0]
        bottom = bottom / bottom[0]
        k = len(bottom) - 1
        own = np.zeros((k, k))
        if k:
            own[0], own[1:, :-1] = -bottom[1:], np.eye(k - 1)
        into = np.eye(k)[:, 0] if k else np.zeros(0)
        n = len(F)
        F = np.block([[F, np.zeros((n, k))], [np.outer(into, H), own]])
        G = np.concatenate([G, np.zeros(k)])
        H = np.concatenate([top[0] * H, top[1:] - top[0] * bottom[1:]])
    assert pilot.sample_time is not None
    return SampledLoop(A=F, B=G, C=H, sample_time=pilot.sample_time)
