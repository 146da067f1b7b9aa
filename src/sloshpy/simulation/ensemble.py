"""Nonlinear runs of a whole batch at once: the settled limit cycle and the greatest motion of each.

The same equations as `simulate`, with the delay by its Pade approximation of order 8 (a phase error below 1e-3 rad far
beyond any slosh) and every closed-loop mode followed exactly between the kicks of the damping. No history is kept, only
the last twenty-one maxima and minima of each signal.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case, continuous
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.states import delay_parts
from sloshpy.errors import OutsideValidity
from sloshpy.simulation.envelope import in_turn, level_envelopes
from sloshpy.simulation.march import DIVERGED
from sloshpy.simulation.modal import Modal, modal_form, packed, paired, parted, unpacked
from sloshpy.simulation.power_terms import power_terms
from sloshpy.simulation.signals import OneMinusCosine
from sloshpy.simulation.simulate import INITIAL_SLOSH
from sloshpy.units import Array, Real

if TYPE_CHECKING:
    import xarray as xr

SLOSH_STEP = 0.2  # radians of the fastest slosh: 6e-5 of a limit cycle
FELT_STEP = 0.07  # where an accelerometer feels the damping force, which then moves the engine: likewise
GUST_STEPS = 100  # that a gust lasts at least: 5e-4 of a peak that falls into it
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
    gust: OneMinusCosine | None = None,
) -> Ensemble:
    """Simulate a batch of cases from displaced slosh and measure each one's settled oscillation.

    Args:
        case: vehicles and autopilots with leading axes, or one.
        duration: s.
        initial_slosh: m, broadcasts with (..., n_tanks).
        step: s, at most; default: 0.2 radians of the fastest slosh (0.07 with an accelerometer), half a radian of the
            fastest bending mode, a hundredth of the shortest gust. Runs of one step do not depend on which others are
            beside them, bit for bit.
        damping_factor: multiplies every law of damping, broadcasts with (..., n_tanks).
        gust: of the lateral wind; its peak in m/s, start >= 0 s and duration broadcast with the batch.

    Raises:
        OutsideValidity: a tabulated law, a law with an end of its validity or an actuator limit, which `simulate`
            handles one case at a time.
    """
    if not duration > 0.0:
        raise ValueError(f"duration must be > 0 s, is {duration:g} s")
    limits = case.autopilot.actuator
    if limits is not None and limits.limited:
        raise OutsideValidity("the ensemble has no actuator limits or dead band: simulate each case, or drop them")
    continuous(case, "simulate_ensemble")
    constant, coefficient, exponent = power_terms(case)
    factor = np.asarray(damping_factor, dtype=float)
    if not np.all(np.isfinite(factor)) or np.any(factor < 0.0):
        raise ValueError("damping factors must be finite and >= 0")
    loop = open_loop(case, factor * constant)
    batch, size = loop.batch, int(np.prod(loop.batch))
    grips = np.broadcast_to(factor[..., None] * coefficient, (*batch, *exponent.shape)).reshape(size, *exponent.shape)
    blows, n = _gusts(case, gust, batch), len(case.vehicle.tanks)
    h = min(_step(loop, case, step), float(np.min(blows[..., 2], initial=np.inf)) / GUST_STEPS)
    start = np.broadcast_to(np.asarray(initial_slosh, dtype=float), (*batch, n)).reshape(size, n)
    found = _each_with_its_own(loop, start, grips, exponent, blows, h, int(np.ceil(duration / h)))
    reason = np.array([next((r for r in row if r), "") for row in found.reason])
    return Ensemble(
        case=case,
        slosh_amplitude=found.amplitude[:, :n].reshape(*batch, n),
        slosh_omega=found.omega[:, :n].reshape(*batch, n),
        tvc_amplitude=found.amplitude[:, n].reshape(batch),
        tvc_omega=found.omega[:, n].reshape(batch),
        slosh_peak=found.peak[:, :n].reshape(*batch, n),
        tvc_peak=found.peak[:, n].reshape(batch),
        settled=(reason == "").reshape(batch),
        reason=reason.reshape(batch),
        duration=duration,
    )


@dataclass(frozen=True, kw_only=True)
class _Marched:
    """Of N trajectories and S signals, (N, S): settled amplitude and frequency, greatest magnitude, reason."""

    amplitude: Array
    omega: Array
    peak: Array
    reason: list[list[str]]


def _gusts(case: Case, gust: OneMinusCosine | None, batch: tuple[int, ...]) -> Array:
    """Return peak in m/s, start and duration in s of each run's gust, (N, E, 3), E none or one."""
    size = int(np.prod(batch))
    if gust is None:
        return np.zeros((size, 0, 3))
    if case.vehicle.aerodynamics is None:
        raise ValueError("wind acts by the aerodynamics, and the case has none")
    parts = [np.broadcast_to(np.asarray(x, dtype=float), batch) for x in (gust.size, gust.start, gust.duration)]
    if not (np.all(np.isfinite(parts)) and np.all(parts[1] >= 0.0) and np.all(parts[2] > 0.0)):
        raise ValueError("a gust needs a finite peak, a start >= 0 s and a duration > 0 s")
    return np.stack([x.reshape(size) for x in parts], axis=-1)[:, None, :]


def _each_with_its_own(
    loop: Loop, start: Array, coefficient: Array, exponent: Array, gusts: Array, h: float, steps: int
) -> "_Marched":
    """Run those loops together whose delay is approximated in so many parts: no bit of one depends on another."""
    parts = delay_parts(loop).reshape(-1)
    kinds = [np.flatnonzero(parts == k) for k in np.unique(parts)]
    done = []
    for rows in kinds:
        own = loop if len(kinds) == 1 else loop.take(rows)
        shape = start[rows].reshape(*own.batch, -1)
        modal = modal_form(own, shape, gusts.shape[1] > 0)
        done.append(_marched(modal, coefficient[rows], exponent, gusts[rows], h, steps))
    back = np.argsort(np.concatenate(kinds), kind="stable")
    reasons = [reason for one in done for reason in one.reason]
    return _Marched(
        amplitude=np.concatenate([one.amplitude for one in done])[back],
        omega=np.concatenate([one.omega for one in done])[back],
        peak=np.concatenate([one.peak for one in done])[back],
        reason=[reasons[k] for k in back],
    )


def _marched(modal: Modal, coefficient: Array, exponent: Array, gusts: Array, h: float, steps: int) -> _Marched:
    """Run the kernel and read the envelopes of what it kept."""
    from sloshpy.simulation.kernel import KEPT, LANES, march  # numba, 0.5 s: only where many runs are wanted

    size, n = coefficient.shape[0], coefficient.shape[1]
    lanes = min(size, LANES)
    groups, signals = -(-size // lanes), n + 1
    high, at, low = (np.zeros((groups, signals, KEPT, lanes)) for _ in range(3))
    count = np.zeros((groups, signals, 2, lanes), dtype=np.int64)
    largest, diverged = np.zeros((groups, signals, lanes)), np.full((groups, lanes), -1, dtype=np.int64)
    modes = [parted(x) for x in (modal.start, np.exp(h * modal.rate), modal.push)] + [paired(modal.rows)]
    start, flow, push, rows = (x.reshape(*x.shape[:-2], -1) for x in (packed(part, lanes) for part in modes))
    jump, force = packed(modal.jump, lanes), packed(coefficient, lanes)
    results = high, at, low, count, largest, diverged
    blows = packed(gusts, lanes)
    march(start, flow, push, rows, jump, force, exponent, blows, h, steps, DIVERGED, *results)
    counts = unpacked(count, size).reshape(-1, 2).astype(int)
    rings = [unpacked(x, size).reshape(-1, KEPT) for x in (high, at, low)]
    last = [in_turn(ring, counts[:, side]) for ring, side in zip(rings, (0, 0, 1), strict=True)]
    found = level_envelopes(last[1], last[0], last[2], np.min(counts, axis=1))
    far = unpacked(diverged, size)
    reasons = [list(found.reason[k * signals : (k + 1) * signals]) for k in range(size)]
    amplitude, omega = found.amplitude.reshape(size, signals), found.omega.reshape(size, signals)
    for k in np.flatnonzero(far >= 0):
        reasons[k] = [f"diverged at {far[k] * h:.1f} s"] * signals
        amplitude[k], omega[k] = np.nan, np.nan
    return _Marched(amplitude=amplitude, omega=omega, peak=unpacked(largest, size), reason=reasons)


def slosh_step(case: Case) -> float:
    """Return the radians of the fastest slosh that a step may have."""
    return SLOSH_STEP if np.all(case.autopilot.accelerometer_gain == 0.0) else FELT_STEP


def _step(loop: Loop, case: Case, most: float | None) -> float:
    slosh = float(np.max(loop.plant.tank_frequency, initial=0.0))
    bending = max((float(np.max(mode.frequency)) for mode in case.vehicle.flexible_modes), default=0.0)
    own = slosh_step(case) / slosh if slosh else np.inf
    return min(own, FLEXIBLE_STEP / bending if bending else np.inf, most or np.inf)
