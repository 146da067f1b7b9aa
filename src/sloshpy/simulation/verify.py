"""Every predicted limit cycle against the nonlinear simulation: amplitude, frequency, engine angle, other harmonics."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import Cycle, limit_cycles, predict_limit_cycle, slosh_cycles
from sloshpy.simulation.envelope import CYCLES
from sloshpy.simulation.simulate import TimeHistory, simulate
from sloshpy.units import Array, compared

if TYPE_CHECKING:
    import xarray as xr

ALIKE = 1e-6  # relative and rad: two degradations that are one
LONGEST = 2400.0  # s of simulation before a cycle is called unconverged
START = 0.8  # of the predicted amplitude, so that the simulation has to find the cycle itself


@dataclass(frozen=True, kw_only=True)
class Verification:
    """One predicted limit cycle and what the simulation settled on.

    loop: "as given", or "degraded by the margin of LOX", of several tanks where they ask for the same degradation.
    predicted: of all tanks coupled, by describing function; None where no cycle can be predicted.
    slosh: simulated amplitudes in m by tank, omega in rad/s, tvc in rad; nan where it did not settle.
    harmonics: rms of the engine motion that is not its fundamental, as a part of the whole.
    reason: "" or why there is no comparison.
    """

    case: Case
    loop: str
    predicted: Cycle | None
    slosh: dict[str, float]
    omega: float
    tvc: float
    harmonics: float
    reason: str

    @property
    def difference(self) -> float:
        """Greatest relative difference of the slosh amplitudes, predicted to simulated, by the greatest amplitude."""
        if self.predicted is None:
            return np.nan
        largest = max(self.slosh.values())
        return max(abs(self.predicted.slosh_amplitude[name] - a) for name, a in self.slosh.items()) / largest

    def __str__(self) -> str:
        lines = [
            f"loop {self.loop}: " + ("nothing predicted" if self.predicted is None else f"predicted {self.predicted}")
        ]
        if self.reason:
            return "\n".join([*lines, f"  {self.reason}"])
        slosh = ", ".join(f"{name} {a:.4f} m" for name, a in self.slosh.items())
        lines.append(f"  simulated at {self.omega / 2.0 / np.pi:.4f} Hz: {slosh}, engine {1e3 * self.tvc:.3f} mrad")
        apart = compared(self.difference, "the simulated amplitude")
        lines.append(f"  difference {apart}, other harmonics {100.0 * self.harmonics:.2f} %")
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return prediction and simulation as an xarray Dataset over the tanks."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        names, one = list(self.slosh), self.predicted
        predicted = [np.nan if one is None else one.slosh_amplitude[name] for name in names]
        return xr.Dataset(
            {
                "predicted": ("tank", predicted, {"units": "m"}),
                "simulated": ("tank", [self.slosh[name] for name in names], {"units": "m"}),
                "predicted_tvc": ((), np.nan if one is None else one.tvc_amplitude, {"units": "rad"}),
                "simulated_tvc": ((), self.tvc, {"units": "rad"}),
            },
            coords={"tank": names},
            attrs={"loop": self.loop, "reason": self.reason},
        )


def verify(case: Case) -> tuple[Verification, ...]:
    """Simulate every limit cycle that is predicted for a case: of the loop as given, and degraded for each tank.

    A stable cycle is started at 0.8 of its amplitude and run until it has settled. An unstable one repels and is
    listed without a simulation. Where one sinusoid predicts nothing, the reason stands in its place.

    Raises:
        OutsideValidity: no cycle of the loop as given can be predicted since several modes grow at once.
    """
    single(case, "verify")
    found = [_simulated(case, "as given", cycle) for cycle in limit_cycles(case)]
    for degraded, tanks in _degraded(case):
        loop = f"degraded by the margin of {' and of '.join(tanks)}"
        try:
            cycles = slosh_cycles(degraded)
        except OutsideValidity as error:  # degraded so far that several modes grow
            found.append(_blank(degraded, loop, None, f"not verified: {error}"))
            continue
        found += [_simulated(degraded, loop, cycle) for cycle in cycles]
    return tuple(found)


def _degraded(case: Case) -> list[tuple[Case, list[str]]]:
    """Return the loops degraded for each tank, those of several tanks that are one loop once, and whose they are."""
    by: list[tuple[float, float, list[str]]] = []
    for j, tank in enumerate(case.vehicle.tanks):
        predicted = predict_limit_cycle(case, j)
        if not predicted.band.size or np.isnan(predicted.degraded_growth):
            continue  # no degradation to simulate: none is needed, or it is a phase advance
        for gain, delay, names in by:
            if abs(predicted.gain / gain - 1.0) < ALIKE and abs(predicted.delay - delay) * predicted.omega < ALIKE:
                names.append(tank.name)
                break
        else:
            by.append((predicted.gain, predicted.delay, [tank.name]))
    return [
        (case.model_copy(update={"autopilot": case.autopilot.degraded(gain, delay)}), names)
        for gain, delay, names in by
    ]


def _blank(case: Case, loop: str, predicted: Cycle | None, reason: str = "") -> Verification:
    return Verification(
        case=case,
        loop=loop,
        predicted=predicted,
        slosh=dict.fromkeys((t.name for t in case.vehicle.tanks), np.nan),
        omega=np.nan,
        tvc=np.nan,
        harmonics=np.nan,
        reason=reason,
    )


def _simulated(case: Case, loop: str, cycle: Cycle) -> Verification:
    blank = _blank(case, loop, cycle)
    if not cycle.stable:
        return replace(blank, reason="not simulated: an unstable cycle repels")
    if not cycle.tank:
        return replace(blank, reason="not simulated: slosh alone does not start it; simulate a pulse of the engine")
    start = START * np.array(list(cycle.slosh_amplitude.values()))
    duration = 100.0 * 2.0 * np.pi / cycle.omega
    while True:
        history = simulate(case, duration, start)
        envelopes = [history.slosh_envelope(j) for j in range(len(start))]
        engine = history.tvc_envelope
        if engine.settled and all(e.settled for e in envelopes):
            break
        if history.stopped or duration >= LONGEST:
            return replace(blank, reason=engine.reason or next(e.reason for e in envelopes if not e.settled))
        duration = min(2.0 * duration, LONGEST)
    return replace(
        blank,
        slosh={name: e.amplitude for name, e in zip(cycle.slosh_amplitude, envelopes, strict=True)},
        omega=engine.omega,
        tvc=engine.amplitude,
        harmonics=_harmonics(history, engine.omega),
    )


def _harmonics(history: TimeHistory, omega: float) -> float:
    """Return the rms left of the engine motion after its mean and fundamental, over the last cycles."""
    last = history.time > history.time[-1] - CYCLES * 2.0 * np.pi / omega
    t, signal = history.time[last], history.tvc[last]
    columns: Array = np.stack([np.ones_like(t), np.cos(omega * t), np.sin(omega * t)], axis=-1)
    fitted = columns @ np.linalg.lstsq(columns, signal, rcond=None)[0]
    return float(np.sqrt(np.mean((signal - fitted) ** 2) / np.mean((signal - np.mean(signal)) ** 2)))
