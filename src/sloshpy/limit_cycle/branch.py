"""One closed-loop slosh mode followed over its amplitude, every tank damped by its own law at its own amplitude.

With the slosh damping taken out and all else eliminated from T(s), delay and controller included, the mode obeys

    [S(s) + s diag(2 xi_j w_j m_j)] z = 0,    xi_j = f_j(W |z_j| / w_j),  s = sigma + j W

in the n slosh amplitudes z alone. Unknown are s and the amplitudes r of the tanks relative to the mode's own, which is
a. Newton's method solves it at one amplitude; along the branch it is solved on planes across its arc, so that a branch
may turn back in amplitude.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sloshpy.damping import DampingLaw, ratios
from sloshpy.damping.laws import MOST_DAMPING
from sloshpy.dynamics.characteristic import characteristic_matrix
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import slosh_damping
from sloshpy.units import Array, ComplexArray

MOST_STEPS = 3000
LONGEST_STEP = 0.15  # along the branch, of ln(amplitude) and of what is scaled to it
SHORTEST_STEP = 1e-7
STRAIGHT = 0.97  # cosine between two tangents: a sharper bend halves the step
ROUNDS = 15
RELATIVE = 1e-6  # step of the difference quotient of a law


@dataclass(frozen=True, kw_only=True)
class Mode:
    """A mode at one amplitude of its own tank.

    amplitude: m. pole: rad/s, sigma + j W. damping: (n_tanks,), ratios. shape: (n_tanks,), complex, slosh of every tank
    relative to its own. tvc: rad, of the engine.
    """

    amplitude: float
    pole: complex
    damping: Array
    shape: ComplexArray
    tvc: float

    @property
    def slosh(self) -> Array:
        """Slosh amplitudes of all tanks, m, (n_tanks,)."""
        return np.asarray(self.amplitude * np.abs(self.shape))


@dataclass(frozen=True, kw_only=True)
class Follower:
    """What is followed: the loop, the damping laws of its tanks, and the tank whose amplitude counts."""

    loop: Loop
    laws: Sequence[DampingLaw]
    tank: int

    def at(self, amplitude: float, near: Mode) -> Mode | None:
        """Return the mode at one amplitude from a mode nearby; None where the laws have no data or none is found."""
        y = self._pack(near)
        y[0] = np.log(amplitude)
        across = np.zeros(len(y))
        across[0] = 1.0
        found = self._corrected(y, across)
        return None if found is None else self._unpack(found[0])

    def along(self, pole: complex, low: float, high: float) -> tuple[Mode, ...]:
        """Return the modes from one amplitude to another, from the closed-loop pole at small amplitude.

        The branch ends early where the laws' data end, where a tank is damped as no slosh is, or where Newton's method
        finds no way on.
        """
        first = self.at(low, self.small(pole, low))
        if first is None:
            return ()
        modes, y = [first], self._pack(first)
        tangent = self._tangent(y, None)
        if tangent is None:
            return (first,)
        step = LONGEST_STEP
        while len(modes) < MOST_STEPS and step > SHORTEST_STEP:
            found = self._corrected(y + step * tangent, tangent)
            turned = None if found is None else self._tangent(found[0], tangent)
            if found is None or turned is None or turned @ tangent < STRAIGHT:
                step *= 0.5
                continue
            if found[0][0] >= np.log(high) or found[0][0] < np.log(low):
                last = self.at(high if found[0][0] > np.log(low) else low, modes[-1])
                modes += [last] if last is not None else []
                break
            y, tangent = found[0], turned
            modes.append(self._unpack(y))
            if np.max(modes[-1].damping) > MOST_DAMPING:
                break
            step = min(1.5 * step if found[1] < 5 else step, LONGEST_STEP)
        return tuple(modes)

    def between(self, one: Mode, other: Mode, share: float) -> Mode | None:
        """Return the mode where the branch crosses the plane at a share of the way between two of its modes."""
        start, way = self._pack(one), self._pack(other) - self._pack(one)
        found = self._corrected(start + share * way, way / np.linalg.norm(way))
        return None if found is None else self._unpack(found[0])

    def small(self, pole: complex, amplitude: float) -> Mode:
        """Return the mode of the loop at its own damping."""
        engine = engine_per_slosh(self.loop, pole)
        z = mode_shape(self.loop, pole)
        shape = z / (z[self.tank] if z[self.tank] != 0.0 else np.finfo(float).eps)
        tvc = amplitude * float(abs(engine @ shape))
        return Mode(amplitude=amplitude, pole=pole, damping=self.loop.damping, shape=shape, tvc=tvc)

    @property
    def _own_frequency(self) -> float:
        return float(self.loop.plant.tank_frequency[self.tank])

    def _pack(self, mode: Mode) -> Array:
        """Return ln a, the other tanks' relative amplitudes, and sigma and W over the tank's frequency."""
        others = np.concatenate([mode.shape[: self.tank], mode.shape[self.tank + 1 :]])
        s = mode.pole / self._own_frequency
        return np.concatenate([[np.log(mode.amplitude)], others.real, others.imag, [s.real, s.imag]])

    def _read(self, y: Array) -> tuple[float, ComplexArray, complex]:
        n = len(self.laws)
        others, j = y[1:n] + 1j * y[n : 2 * n - 1], self.tank
        shape = np.concatenate([others[:j], [1.0], others[j:]])
        return float(np.exp(y[0])), shape, complex(y[-2], y[-1]) * self._own_frequency

    def _unpack(self, y: Array) -> Mode:
        a, shape, s = self._read(y)
        p = self.loop.plant
        xi = ratios(self.laws, abs(s.imag) * a * np.abs(shape) / p.tank_frequency)
        engine = engine_per_slosh(self.loop, s)
        return Mode(amplitude=a, pole=s, damping=xi, shape=shape, tvc=a * float(abs(engine @ shape)))

    def _equations(self, y: Array) -> tuple[Array, Array]:
        """Return the residual, (2n,), and its derivatives, (2n, 2n+1); nan where a law has no data."""
        a, r, s = self._read(y)
        p, n, W = self.loop.plant, len(self.laws), abs(s.imag)
        size = np.abs(r)
        A = W * a * size / p.tank_frequency
        h = RELATIVE * A
        xi, above, below = ratios(self.laws, np.stack([A, A + h, A - h]))
        upper, lower = np.where(np.isnan(above), xi, above), np.where(np.isnan(below), xi, below)
        width = h * (2.0 - np.isnan(above) - np.isnan(below))  # at an end of the data the quotient is one-sided
        slope = np.where(width > 0.0, (upper - lower) / np.where(width > 0.0, width, 1.0), 0.0)  # df/dA
        S, dS, _ = slosh_stiffness(self.loop, s)
        D, dD = slosh_damping(p, xi), slosh_damping(p, slope * A)  # dD is by ln A
        scale = _row_scale(self.loop)
        M = scale[:, None] * (S + s * np.diag(D))
        G = M @ r
        by_s = (scale[:, None] * (dS + np.diag(D))) @ r
        hit = np.diag(scale * s * dD * r)  # column j: what ln A_j moves
        with np.errstate(divide="ignore", invalid="ignore"):
            toward = np.where(size > 0.0, r / size**2, 0.0)  # d ln|r| by real and imaginary part
        columns = [hit.sum(axis=1)]
        columns += [M[:, k] + hit[:, k] * toward[k].real for k in range(n) if k != self.tank]
        columns += [1j * M[:, k] + hit[:, k] * toward[k].imag for k in range(n) if k != self.tank]
        w = self._own_frequency
        columns += [w * by_s, w * (1j * by_s + hit.sum(axis=1) * np.sign(s.imag) / W)]
        J = np.stack(columns, axis=1)
        return np.concatenate([G.real, G.imag]), np.concatenate([J.real, J.imag])

    def _tangent(self, y: Array, before: Array | None) -> Array | None:
        """Return the unit direction of the branch, onward from the one before or toward greater amplitudes."""
        J = self._equations(y)[1]
        if not np.all(np.isfinite(J)):
            return None
        t = np.linalg.svd(J)[2][-1]
        return np.asarray(t * np.sign(t[0] if before is None else t @ before))

    def _corrected(self, y: Array, across: Array) -> tuple[Array, int] | None:
        """Return the point of the branch on the plane through y across a direction, and the rounds it took."""
        start = y
        for k in range(ROUNDS):
            G, J = self._equations(y)
            if not (np.all(np.isfinite(G)) and np.all(np.isfinite(J))):
                return None
            try:
                step = np.linalg.solve(np.vstack([J, across]), -np.append(G, across @ (y - start)))
            except np.linalg.LinAlgError:
                return None
            y = y + step
            if np.max(np.abs(step)) < 1e-11 * max(1.0, float(np.max(np.abs(y[1:])))):
                return y, k
        return None


def mode_shape(loop: Loop, pole: complex) -> ComplexArray:
    """Return the complex slosh amplitudes of a closed-loop mode, (n_tanks,), of any common size and phase."""
    S = slosh_stiffness(loop, pole)[0]
    D = slosh_damping(loop.plant, loop.damping)
    return np.asarray(np.conj(np.linalg.svd(_row_scale(loop)[:, None] * (S + pole * np.diag(D)))[2][-1]))


def _row_scale(loop: Loop) -> Array:
    return np.asarray(1.0 / (loop.plant.tank_mass * loop.plant.tank_frequency**2))


def slosh_stiffness(loop: Loop, s: complex) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return S(s) of the slosh coordinates without slosh damping, dS/ds, and the engine angle per slosh, (n,)."""
    T, dT, n = _slosh_last(loop, s)
    rest, beside, across = T[:n, :n], T[:n, n:], T[n:, :n]
    right = np.linalg.solve(rest, beside)  # -right: all other coordinates per slosh
    left = np.linalg.solve(rest.T, across.T).T
    S = T[n:, n:] - across @ right
    dS = dT[n:, n:] - dT[n:, :n] @ right - left @ dT[:n, n:] + left @ dT[:n, :n] @ right
    return S, dS, -right[-1]


def engine_per_slosh(loop: Loop, s: complex) -> ComplexArray:
    """Return the engine angle per slosh, (n_tanks,)."""
    T, _, n = _slosh_last(loop, s)
    return np.asarray(-np.linalg.solve(T[:n, :n], T[:n, n:])[-1])


def _slosh_last(loop: Loop, s: complex) -> tuple[ComplexArray, ComplexArray, int]:
    """Return T(s) and dT/ds without slosh damping, the slosh coordinates behind the others, and how many others."""
    T, dT = characteristic_matrix(replace(loop, damping=np.zeros_like(loop.damping)), np.array(s))
    own = list(range(len(T) - 1))[loop.plant.slosh]
    order = np.array([*(k for k in range(len(T)) if k not in own), *own])
    return T[order][:, order], dT[order][:, order], len(T) - len(own)
