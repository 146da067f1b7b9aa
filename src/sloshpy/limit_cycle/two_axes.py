"""Limit cycles of pitch and yaw together: a slosh mass free in its plane, damped by its speed.

The two axes have their own loops and share the tanks. A damper that depends on the speed |v| of the mass in the plane
couples them: its force is h(|v|) v, and its fundamental on each axis follows from one period of the motion. Planar
motion is that of one axis alone. In circular motion the speed is constant, so that a power law damps 1/g(p) times as
much as in planar motion of the same amplitude: the circular cycle is the smaller one, and with equal loops the one that
attracts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.damping import DampingLaw
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import closed_loop_eigenvalues
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle.branch import slosh_stiffness
from sloshpy.limit_cycle.cycles import greatest_disturbance, slosh_cycles
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr

SAMPLES = 512  # of one period; the kink of |v| v costs 1e-7
PHASE = 1e-5  # of the frequency: the samples place the cycle's own phase no nearer to zero
REST = 1e-6  # of the greatest amplitude: an axis below this is at rest


@dataclass(frozen=True, kw_only=True)
class TwoAxisCycle:
    """A limit cycle in the plane: complex slosh amplitudes of pitch and yaw at one frequency.

    omega: rad/s. pitch, yaw: (n_tanks,), complex, m. tvc: (2,), engine amplitudes of pitch and yaw, rad. disturbance:
    greatest growth rate of a small disturbance in either axis, 1/s; the cycle attracts where it is negative.
    """

    pitch_case: Case
    yaw_case: Case
    omega: float
    pitch: ComplexArray
    yaw: ComplexArray
    tvc: Array
    disturbance: float

    @property
    def stable(self) -> bool:
        """Whether every small disturbance, in either axis, dies out."""
        return self.disturbance < 0.0

    @property
    def axes(self) -> Array:
        """Half axes of each tank's ellipse, greater first, m, (n_tanks, 2)."""
        size = np.abs(self.pitch) ** 2 + np.abs(self.yaw) ** 2
        area = np.abs((np.conj(self.pitch) * self.yaw).imag)
        both = np.sqrt(np.maximum(size + 2.0 * area, 0.0)), np.sqrt(np.maximum(size - 2.0 * area, 0.0))
        return np.stack([0.5 * (both[0] + both[1]), 0.5 * (both[0] - both[1])], axis=-1)

    @property
    def kind(self) -> str:
        """The shape of the motion: "planar in pitch", "planar in yaw", "planar", "circular" or "elliptic"."""
        a, b = self.axes[int(np.argmax(self.axes[:, 0]))]
        if b < 1e-3 * a:
            pitch, yaw = float(np.max(np.abs(self.pitch))), float(np.max(np.abs(self.yaw)))
            return "planar in pitch" if yaw < REST * pitch else "planar in yaw" if pitch < REST * yaw else "planar"
        return "circular" if b > 0.999 * a else "elliptic"

    def __str__(self) -> str:
        names = [tank.name for tank in self.pitch_case.vehicle.tanks]
        slosh = ", ".join(f"{name} {a:.4f} x {b:.4f} m" for name, (a, b) in zip(names, self.axes, strict=True))
        engine = f"engine {1e3 * self.tvc[0]:.3f} and {1e3 * self.tvc[1]:.3f} mrad"
        attracts = "attracts" if self.stable else "repels"
        return f"{self.kind} limit cycle at {self.omega / 2 / np.pi:.4f} Hz, {attracts}: {slosh}, {engine}"

    def to_dataset(self) -> "xr.Dataset":
        """Return the half axes and engine amplitudes as an xarray Dataset."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "axes": (["tank", "half_axis"], self.axes, {"units": "m"}),
                "tvc": ("loop", self.tvc, {"units": "rad"}),
                "omega": ((), self.omega, {"units": "rad/s"}),
                "disturbance": ((), self.disturbance, {"units": "1/s"}),
            },
            coords={"tank": [t.name for t in self.pitch_case.vehicle.tanks], "loop": ["pitch", "yaw"]},
            attrs={"kind": self.kind, "stable": int(self.stable)},
        )


def two_axis_cycles(pitch: Case, yaw: Case | None = None) -> tuple[TwoAxisCycle, ...]:
    """Return the limit cycles of a vehicle in its plane: planar in each axis, and those in which both take part.

    The one-sinusoid balance is solved from every planar cycle and from its circular and elliptic companions.

    Args:
        pitch: one vehicle and autopilot.
        yaw: likewise, with the same tanks; default: as in pitch.

    Raises:
        ValueError: the two have different tanks.
        OutsideValidity: several modes of one axis grow at once, or no planar cycle attracts, see `slosh_cycles`.
    """
    yaw = pitch if yaw is None else yaw
    single(pitch, "two_axis_cycles")
    single(yaw, "two_axis_cycles")
    for one, other in zip(pitch.vehicle.tanks, yaw.vehicle.tanks, strict=False):
        if (one.slosh_mass, one.frequency, one.damping) != (other.slosh_mass, other.frequency, other.damping):
            raise ValueError(f"pitch and yaw share their tanks, but {one.name} differs: it moves in both")
    if len(pitch.vehicle.tanks) != len(yaw.vehicle.tanks):
        raise ValueError("pitch and yaw share their tanks, but their numbers differ")
    plane = _Plane(loops=(open_loop(pitch), open_loop(yaw)), laws=[t.damping for t in pitch.vehicle.tanks])
    found: list[TwoAxisCycle] = []
    for z, W in _starts(plane, pitch, yaw):
        solved = plane.balanced(z, W)
        if solved is None:
            continue
        cycle = _cycle(pitch, yaw, plane, *solved)
        for case, angle in zip((pitch, yaw), cycle.tvc, strict=True):
            if case.autopilot.actuator is not None and bool(case.autopilot.actuator.beyond(angle, cycle.omega)):
                raise OutsideValidity("an engine meets its limits or dead band, which two axes do not know")
        if not any(_same(cycle, other) for other in found):
            found.append(cycle)
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class _Plane:
    """Two loops over the same tanks. z holds the amplitudes of all tanks in pitch and then in yaw, (2n,), complex."""

    loops: tuple[Loop, Loop]
    laws: Sequence[DampingLaw]

    def stiffness(self, s: complex) -> tuple[ComplexArray, ComplexArray]:
        """Return S(s) and dS/ds of both axes, (2n, 2n)."""
        n = len(self.laws)
        S, dS = np.zeros((2 * n, 2 * n), dtype=complex), np.zeros((2 * n, 2 * n), dtype=complex)
        for k, loop in enumerate(self.loops):
            rows = slice(k * n, (k + 1) * n)
            S[rows, rows], dS[rows, rows], _ = slosh_stiffness(loop, s)
        return S, dS

    def velocity(self, z: ComplexArray, W: float) -> Array:
        """Return one period of the slosh velocities, (2, n, SAMPLES), m/s."""
        turn = np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)
        return np.asarray((1j * W * z[:, None] * turn).real.reshape(2, len(self.laws), SAMPLES))

    def force(self, z: ComplexArray, W: float) -> ComplexArray:
        """Return the fundamental of the damping force on each axis, (2n,), N; nan outside a law's data."""
        v = self.velocity(z, W)
        speed = np.hypot(v[0], v[1])
        p = self.loops[0].plant
        grip = np.stack(
            [
                -_grip(law, speed[j], float(w))
                for j, (law, w) in enumerate(zip(self.laws, p.tank_frequency, strict=True))
            ]
        )
        fundamental = 2.0 * np.fft.fft(grip * v, axis=-1)[..., 1] / SAMPLES
        return np.asarray((p.tank_mass * fundamental).reshape(-1))

    def balanced(self, z: ComplexArray, W: float) -> tuple[ComplexArray, float] | None:
        """Return amplitudes and frequency at which the balance holds, from a guess; None where it finds none."""
        from scipy.optimize import root  # 0.3 s: only where a limit cycle may be

        own = int(np.argmax(np.abs(z)))
        size, turn = abs(z[own]), z[own] / abs(z[own])
        scale = np.tile(1.0 / (self.loops[0].plant.tank_mass * self.loops[0].plant.tank_frequency ** 2), 2) / size
        others = np.delete(np.arange(len(z)), own)

        def read(y: Array) -> tuple[ComplexArray, float]:
            full = np.empty(len(z), dtype=complex)
            full[own] = size * y[0]
            full[others] = size * (y[2 : 2 + len(others)] + 1j * y[2 + len(others) :])
            return full, W * y[1]

        def residual(y: Array) -> Array:
            full, here = read(y)
            lack = scale * (self.stiffness(1j * here)[0] @ full - self.force(full, here))
            lack = np.where(np.isfinite(lack), lack, 1e3)
            return np.concatenate([lack.real, lack.imag])

        rest = np.delete(z / turn, own) / size
        start = np.concatenate([[1.0, 1.0], rest.real, rest.imag])
        found = root(residual, start, tol=1e-13)
        full, here = read(found.x)
        if np.max(np.abs(residual(found.x))) > 1e-9 or not abs(full[own]) > REST * size or not here > 0.0:
            return None
        return full, here

    def disturbance(self, z: ComplexArray, W: float) -> float:
        """Return the greatest growth of a disturbance of a cycle, 1/s."""
        v, n = self.velocity(z, W), len(self.laws)
        speed = np.hypot(v[0], v[1])
        p = self.loops[0].plant
        direct, across = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n), dtype=complex)
        for j, law in enumerate(self.laws):
            w = float(p.tank_frequency[j])
            h = _grip(law, speed[j], w)
            step = 1e-5 * np.max(speed[j], initial=1e-300)
            slope = (_grip(law, speed[j] + step, w) - _grip(law, np.abs(speed[j] - step), w)) / (2.0 * step)
            with np.errstate(invalid="ignore", divide="ignore"):
                steep = np.where(speed[j] > 0.0, slope / speed[j], 0.0)
            for a in range(2):
                for b in range(2):
                    J = p.tank_mass[j] * (h * (a == b) + steep * v[a, j] * v[b, j])
                    harmonics = np.fft.fft(J) / SAMPLES
                    direct[a * n + j, b * n + j] = harmonics[0].real
                    across[a * n + j, b * n + j] = harmonics[2]
        own = 2.0 * p.tank_frequency * p.tank_mass
        poles = [
            closed_loop_eigenvalues(replace(loop, damping=np.diag(direct)[k * n : (k + 1) * n] / own))
            for k, loop in enumerate(self.loops)
        ]
        return greatest_disturbance(self.stiffness, W, direct, across, np.concatenate(poles), PHASE)


def _grip(law: DampingLaw, speed: Array, natural_frequency: float) -> Array:
    """Return h(|v|) of the damping force -h(|v|) v, 1/s."""
    least = np.maximum(speed, 1e-12 * np.max(speed, initial=1e-300))
    return np.asarray(-law.acceleration(least, natural_frequency) / least)


def _starts(plane: _Plane, pitch: Case, yaw: Case) -> list[tuple[ComplexArray, float]]:
    """Return guesses: each axis's planar cycles, and those with the other axis a quarter turn behind or in step."""
    starts = []
    n = len(plane.laws)
    for k, case in enumerate((pitch, yaw)):
        for cycle in slosh_cycles(case):
            mode = _shape(plane.loops[k], cycle.omega, cycle.slosh_amplitude)
            rest = np.zeros(n, dtype=complex)
            starts.append((np.concatenate([mode, rest] if k == 0 else [rest, mode]), cycle.omega))
            for share in (1.0, 0.5):
                both = [0.87 * mode, 0.87 * share * 1j * mode]
                starts.append((np.concatenate(both if k == 0 else both[::-1]), cycle.omega))
    return starts


def _shape(loop: Loop, W: float, amplitude: dict[str, float]) -> ComplexArray:
    """Return the complex slosh amplitudes of a planar cycle, which the balance then makes exact."""
    from sloshpy.dynamics.response import transfer

    z = transfer(loop, np.array(1j * W)).slosh
    return np.asarray(np.array(list(amplitude.values())) * np.exp(1j * (np.angle(z) - np.angle(z[0]))))


def _cycle(pitch: Case, yaw: Case, plane: _Plane, z: ComplexArray, W: float) -> TwoAxisCycle:
    n = len(plane.laws)
    tvc = [abs(slosh_stiffness(loop, 1j * W)[2] @ z[k * n : (k + 1) * n]) for k, loop in enumerate(plane.loops)]
    return TwoAxisCycle(
        pitch_case=pitch,
        yaw_case=yaw,
        omega=W,
        pitch=z[:n],
        yaw=z[n:],
        tvc=np.array(tvc),
        disturbance=plane.disturbance(z, W),
    )


def _same(one: TwoAxisCycle, other: TwoAxisCycle) -> bool:
    """Whether two cycles are one, also when they turn the other way round."""
    near = np.allclose(one.axes, other.axes, rtol=1e-5, atol=1e-6 * np.max(one.axes))
    first, second = (np.abs(np.concatenate([c.pitch, c.yaw])) for c in (one, other))
    circular = one.kind == other.kind == "circular"
    oblique = one.pitch_case == one.yaw_case and one.kind == "planar" and other.kind.startswith("planar")
    return near and (circular or oblique or np.allclose(first, second, rtol=1e-4, atol=1e-5 * np.max(first)))
