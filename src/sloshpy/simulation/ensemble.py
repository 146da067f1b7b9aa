"""Nonlinear runs of a whole batch at once: the settled limit cycle and the greatest motion of each.

The same equations as `simulate`, with the delay by its Pade approximation of order 8 (a phase error below 1e-3 rad far
beyond any slosh) and every closed-loop mode followed exactly between the kicks of the damping.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.batch import case_shape
from sloshpy.case import Case, continuous
from sloshpy.damping import AnyDamping, ConstantDamping, PowerDamping, SumDamping
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import controller, system_matrix
from sloshpy.dynamics.sensed import fed
from sloshpy.errors import OutsideValidity
from sloshpy.simulation.envelope import Envelope, level_envelope
from sloshpy.simulation.march import DIVERGED
from sloshpy.simulation.simulate import INITIAL_SLOSH
from sloshpy.units import Array, ComplexArray, Real

if TYPE_CHECKING:
    import xarray as xr

SLOSH_STEP = 0.1  # radians of the fastest slosh: 1e-5 of a limit cycle
FLEXIBLE_STEP = 0.5  # radians of the fastest bending mode, which must not pass between two samples


@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """What each run of a batch shows; leading axes are the batch's.

    slosh_amplitude, slosh_omega: (..., n_tanks), settled half peak-to-peak in m and rad/s; nan where not settled.
    tvc_amplitude, tvc_omega: (...), rad, at the engine, and rad/s. slosh_peak, tvc_peak: greatest magnitude of the run.
    settled: (...), whether engine and every tank have settled. reason: (...), texts, "" where settled.
    """

    case: Case
    slosh_amplitude: Array
    slosh_omega: Array
    tvc_amplitude: Array
    tvc_omega: Array
    slosh_peak: Array
    tvc_peak: Array
    settled: Array
    reason: Array
    duration: float

    def __str__(self) -> str:
        count, done = self.settled.size, int(np.sum(self.settled))
        lines = [f"{count} runs of {self.duration:g} s: {done} settled"]
        if done:
            engine = 1e3 * self.tvc_amplitude[np.isfinite(self.tvc_amplitude)]
            lines.append(f"  engine {np.min(engine):.4g} to {np.max(engine):.4g} mrad, median {np.median(engine):.4g}")
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return the numbers as an xarray Dataset over the batch and the tanks."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        axes = [f"batch_{i}" for i in range(self.settled.ndim)]
        return xr.Dataset(
            {
                "slosh_amplitude": ([*axes, "tank"], self.slosh_amplitude, {"units": "m"}),
                "slosh_omega": ([*axes, "tank"], self.slosh_omega, {"units": "rad/s"}),
                "slosh_peak": ([*axes, "tank"], self.slosh_peak, {"units": "m"}),
                "tvc_amplitude": (axes, self.tvc_amplitude, {"units": "rad"}),
                "tvc_omega": (axes, self.tvc_omega, {"units": "rad/s"}),
                "tvc_peak": (axes, self.tvc_peak, {"units": "rad"}),
                "settled": (axes, self.settled),
            },
            coords={"tank": [t.name for t in self.case.vehicle.tanks]},
        )


def simulate_ensemble(
    case: Case,
    duration: float = 300.0,
    initial_slosh: Real = INITIAL_SLOSH,
    step: float | None = None,
    damping_factor: Real = 1.0,
) -> Ensemble:
    """Simulate a batch of cases from displaced slosh and measure each one's settled oscillation.

    Args:
        case: vehicles and autopilots with leading axes, or one.
        duration: s.
        initial_slosh: m, broadcasts with (..., n_tanks).
        step: s, at most; default: a tenth of the fastest slosh radian, and half a radian of the fastest bending mode.
            Runs of one step do not depend on which others are beside them, bit for bit.
        damping_factor: multiplies every law of damping, broadcasts with (..., n_tanks).

    Raises:
        OutsideValidity: a tabulated law, a law with an end of its validity or an actuator limit, which `simulate`
            handles one case at a time.
    """
    from sloshpy.simulation.kernel import LANES, march  # numba, 0.5 s: only where many runs are wanted

    if not duration > 0.0:
        raise ValueError(f"duration must be > 0 s, is {duration:g} s")
    limits = case.autopilot.actuator
    if limits is not None and limits.limited:
        raise OutsideValidity("the ensemble has no actuator limits or dead band: simulate each case, or drop them")
    continuous(case, "simulate_ensemble")
    constant, coefficient, exponent = _laws(case)
    factor = np.asarray(damping_factor, dtype=float)
    if not np.all(np.isfinite(factor)) or np.any(factor < 0.0):
        raise ValueError("damping factors must be finite and >= 0")
    loop = open_loop(case, factor * constant)
    modal = _modal(loop, case, initial_slosh)
    batch, size = loop.batch, int(np.prod(loop.batch))
    grips = np.broadcast_to(factor[..., None] * coefficient, (*batch, *exponent.shape)).reshape(size, *exponent.shape)
    h = _step(loop, case, step)
    steps = int(np.ceil(duration / h))
    lanes = -(-size // LANES) * LANES

    def grouped(x: Any) -> Array:
        """Put the trajectories, first axis, into groups of lanes, last axis; the last one repeats to fill up."""
        filled = np.concatenate([x, np.repeat(x[-1:], lanes - size, axis=0)])
        return np.ascontiguousarray(np.moveaxis(filled.reshape(-1, LANES, *x.shape[1:]), 1, -1))

    def ungrouped(x: Any) -> Array:
        return np.asarray(np.moveaxis(x, -1, 1).reshape(lanes, *x.shape[1:-1])[:size])

    flow = np.exp(0.5 * h * modal.rate)
    parts = [modal.start, flow, modal.velocity, modal.push]
    split = [grouped(part) for x in parts for part in (x.real, x.imag)]
    rows = [grouped(part) for x in (modal.signal, modal.slope) for part in (x.real, x.imag)]
    groups, watched, n = lanes // LANES, modal.signal.shape[1], len(case.vehicle.tanks)
    peaks = [np.zeros((groups, watched, 48, LANES)) for _ in range(3)]
    counts = [np.zeros((groups, watched, LANES), dtype=np.int64) for _ in range(2)]
    largest, diverged = np.zeros((groups, watched, LANES)), np.full((groups, LANES), -1, dtype=np.int64)
    results: list[Any] = [*peaks[:2], counts[0], peaks[2], counts[1], largest, diverged]
    given: list[Any] = [grouped(grips), exponent, *rows, np.full((groups, LANES), h), steps, DIVERGED]
    arguments: list[Any] = [*split, grouped(modal.coupling), *given, *results]
    march(*arguments)
    high, high_at, high_count, low, low_count, top, far = (ungrouped(x) for x in results)
    found = [
        [
            _envelope(high[i, q], high_at[i, q], high_count[i, q], low[i, q], low_count[i, q], top[i, q], far[i], h)
            for q in range(watched)
        ]
        for i in range(size)
    ]
    amplitude = np.array([[e.amplitude for e in row] for row in found])
    omega = np.array([[e.omega for e in row] for row in found])
    reason = np.array([next((e.reason for e in row if e.reason), "") for row in found])
    return Ensemble(
        case=case,
        slosh_amplitude=amplitude[:, :n].reshape(*batch, n),
        slosh_omega=omega[:, :n].reshape(*batch, n),
        tvc_amplitude=amplitude[:, n].reshape(batch),
        tvc_omega=omega[:, n].reshape(batch),
        slosh_peak=top[:, :n].reshape(*batch, n),
        tvc_peak=top[:, n].reshape(batch),
        settled=(reason == "").reshape(batch),
        reason=reason.reshape(batch),
        duration=duration,
    )


def _envelope(high: Array, at: Array, highs: int, low: Array, lows: int, top: float, far: int, h: float) -> Envelope:
    """Return the settled envelope of one signal from its ring of last peaks."""
    if far >= 0:
        return Envelope(amplitude=np.nan, omega=np.nan, reason=f"diverged at {far * h:.1f} s")
    kept = len(high)
    last_high = np.roll(high, -(highs % kept))[max(kept - highs, 0) :] if highs else high[:0]
    last_at = np.roll(at, -(highs % kept))[max(kept - highs, 0) :] if highs else at[:0]
    last_low = np.roll(low, -(lows % kept))[max(kept - lows, 0) :] if lows else low[:0]
    return level_envelope(last_at, last_high, last_low)


@dataclass(frozen=True, kw_only=True)
class _Modal:
    """Modal form of a flattened batch; a conjugate pair is one mode, the real part of its rows counted twice.

    rate, start: (N, m). velocity, push: (N, n, m). coupling: (N, n, n). signal, slope: (N, n + 1, m).
    """

    rate: ComplexArray
    start: ComplexArray
    velocity: ComplexArray
    push: ComplexArray
    coupling: Array
    signal: ComplexArray
    slope: ComplexArray


def _modal(loop: Loop, case: Case, initial_slosh: Real) -> _Modal:
    A, _ = system_matrix(loop)
    batch, N, n = loop.batch, A.shape[-1], len(loop.plant.tanks)
    size = int(np.prod(batch))
    A = A.reshape(size, N, N)
    rows_of = slosh_rows(loop, N)
    z_rows, v_rows = rows_of.displacement, rows_of.velocity
    push = np.broadcast_to(rows_of.push, (*batch, n, N)).reshape(size, n, N)
    # without an actuator the engine is taken before the delay, which moves it in time alone: its approximation passes
    # the kicks of the damping straight on
    prompt = replace(loop, autopilot=loop.autopilot.model_copy(update={"delay": 0.0}))
    shown = loop if loop.autopilot.actuator is not None else prompt
    beta = np.broadcast_to(engine_row(shown, N), (*batch, N)).reshape(size, N)
    start, first = np.zeros((size, N)), np.asarray(initial_slosh, dtype=float)
    start[:, loop.plant.slosh_states] = np.broadcast_to(first, (*batch, n)).reshape(size, n)
    rate, V = (x.astype(complex) for x in np.linalg.eig(A))  # real where no mode of the whole batch oscillates
    W = np.linalg.inv(V)
    order = np.argsort(rate.imag < 0.0, axis=-1, kind="stable")  # the upper ones first
    upper = np.take_along_axis(rate.imag >= 0.0, order, axis=-1)
    kept = int(np.max(np.sum(upper, axis=-1)))
    order, upper = order[:, :kept], upper[:, :kept]
    rate = np.take_along_axis(rate, order, axis=-1)
    V = np.take_along_axis(V, order[:, None, :], axis=2)
    W = np.take_along_axis(W, order[:, :, None], axis=1)
    weight = np.where(upper, np.where(rate.imag > 0.0, 2.0, 1.0), 0.0)
    rows = np.concatenate([np.broadcast_to(z_rows, (size, n, N)), beta[:, None, :]], axis=1)
    signal = rows @ V * weight[:, None, :]
    velocity = v_rows @ V * weight[:, None, :]
    return _Modal(
        rate=np.where(upper, rate, -1.0),
        start=np.einsum("kmi,ki->km", W, start),
        velocity=velocity,
        push=np.einsum("kmi,kji->kjm", W, push),
        coupling=np.einsum("ji,kli->kjl", v_rows, push),
        signal=signal,
        slope=signal * rate[:, None, :],
    )


@dataclass(frozen=True, kw_only=True)
class SloshRows:
    """Where slosh stands in the state of `system_matrix`: rows that pick it, and what a unit acceleration moves.

    displacement, velocity: (n_tanks, N). push: (..., n_tanks, N), rate of change of the state.
    """

    displacement: Array
    velocity: Array
    push: Array


def slosh_rows(loop: Loop, size: int) -> SloshRows:
    """Return the rows of a loop, or of a batch, whose state has so many entries."""
    p = loop.plant
    n, half = len(p.tanks), p.mass.shape[-1]
    states = 2 * half - int(p.velocity_only)
    displacement, velocity = np.zeros((n, size)), np.zeros((n, size))
    for j in range(n):
        displacement[j, p.slosh_states.start + j] = 1.0
        velocity[j, states - half + p.slosh.start + j] = 1.0
    push = np.zeros((*p.mass.shape[:-2], n, size))
    moved = np.swapaxes(np.linalg.inv(p.mass)[..., p.slosh], -1, -2) * p.tank_mass[..., None]
    push[..., states - half : states] = moved
    felt = fed(loop).acceleration
    if felt is not None:  # an accelerometer feels the damping force at once
        B = controller(loop)[1]
        direct = np.einsum("...i,...ji->...j", felt, moved)
        shape = np.broadcast_shapes(push.shape[:-2], direct.shape[:-1], B.shape[:-1])
        push = np.broadcast_to(push, (*shape, n, size)).copy()
        push[..., states:] = direct[..., None] * B[..., None, :]
    return SloshRows(displacement=displacement, velocity=velocity, push=push)


def engine_row(loop: Loop, size: int) -> Array:
    """Return the row that picks the engine angle from the state of `system_matrix`, (..., size)."""
    c = fed(loop).c
    states = c.shape[-1]
    _, _, C, D, _ = controller(loop)
    row = np.zeros((*loop.batch, size))
    row[..., :states] = np.asarray(D)[..., None] * c  # an accelerometer is fed back through a lag alone: then D is 0
    row[..., states : states + C.shape[-1]] = C
    return row


def _laws(case: Case) -> tuple[Array, Array, Array]:
    """Return what each tank's law is made of: constant ratio (n,), and power terms c |v|^p v.

    Coefficients are (..., n, K), since c = c_1 w^(1 - p) follows the slosh frequency; exponents (n, K).
    """
    constant, terms = [], []
    for tank in case.vehicle.tanks:
        ratio, powers = 0.0, []
        for part in _parts(tank.damping):
            if isinstance(part, ConstantDamping):
                ratio += part.constant_ratio
            elif isinstance(part, PowerDamping):
                if part.holds_to is not None:  # the kernel does not look where a law ends
                    raise OutsideValidity(
                        f"{tank.name} has a law that holds to {part.holds_to:g} m only: simulate each case"
                    )
                powers.append((part.coefficient(1.0), part.exponent))
            else:
                raise OutsideValidity(f"{tank.name} has a tabulated law: simulate each case")
        constant.append(ratio)
        terms.append(powers)
    most = max((len(t) for t in terms), default=0) or 1
    filled = np.array([[*t, *[(0.0, 1.0)] * (most - len(t))] for t in terms]).reshape(-1, most, 2)
    exponent = np.ascontiguousarray(filled[..., 1])
    w = [np.broadcast_to(np.asarray(tank.frequency, dtype=float), case_shape(case)) for tank in case.vehicle.tanks]
    at = np.stack(w, axis=-1)[..., None] if w else np.ones((0, 1))
    return np.array(constant), filled[..., 0] * at ** (1.0 - exponent), exponent


def _parts(law: AnyDamping) -> tuple[AnyDamping, ...]:
    return tuple(p for part in law.of for p in _parts(part)) if isinstance(law, SumDamping) else (law,)


def _step(loop: Loop, case: Case, most: float | None) -> float:
    slosh = float(np.max(loop.plant.tank_frequency, initial=0.0))
    bending = max((float(np.max(mode.frequency)) for mode in case.vehicle.flexible_modes), default=0.0)
    return min(SLOSH_STEP / slosh, FLEXIBLE_STEP / bending if bending else np.inf, most or np.inf)
