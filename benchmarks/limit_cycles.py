"""Error of the predicted limit cycle against converged simulation and the exact orbit, on random vehicles.

1 to 4 tanks, power laws of exponent 0.5 to 2, delays to 0.2 s, actuators, filters. Vehicle k is the same however many
are asked for; vehicles are drawn until so many have a mode that grows at small amplitude, and every one drawn is in
the table. The table and what it means: docs/limit-cycles.md.

    OPENBLAS_NUM_THREADS=1 python benchmarks/limit_cycles.py --vehicles 300

The simulation is the ensemble kernel; it starts a tenth away from the exact orbit and runs for twelve time constants of
the slowest disturbance. Where nothing is predicted to attract, or it does not, it starts small.
The error is the greatest difference of the slosh amplitudes in parts of the greatest amplitude.
"""

import argparse
import collections
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sloshpy.case import Case
from sloshpy.damping import PowerDamping
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import Cycle, PeriodicOrbit, limit_cycles, periodic_orbit
from sloshpy.limit_cycle.cycles import one_sinusoid_cycles
from sloshpy.simulation import Ensemble, simulate_ensemble
from sloshpy.simulation.ensemble import SLOSH_STEP
from sloshpy.units import Array, ComplexArray

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from cases import random_case

SEED = 25
LONGEST_DELAY = 0.2  # s
START = 0.9  # of the exact orbit: the simulation has to find it itself
SMALL = 1e-3  # m, where nothing is predicted to attract
CONSTANTS = 12.0  # time constants of the slowest disturbance: a tenth has become 1e-6
FROM_SMALL = 25.0  # likewise, to grow from small slosh or to come to rest
SHORTEST, LONGEST = 60.0, 30000.0  # cycles
ALIKE = 1e-3  # the exact orbit and the simulation agree
KINDS = {
    "cycle": "cycle predicted; exact orbit and simulation agree on it",
    "slow": "cycle predicted, the exact orbit agrees; it attracts too slowly to be simulated",
    "other": "cycle predicted; the simulation settles elsewhere",
    "unsettled": "cycle predicted; the simulation does not settle",
    "mistaken": "cycle predicted; the exact orbit repels or is not there",
    "settles": "no cycle predicted; the simulation settles into one",
    "several": "no cycle predicted; the simulation does not settle",
    "diverges": "no cycle predicted; the simulation diverges",
    "rest": "no cycle predicted; the simulation comes to rest",
    "too slow": "no cycle predicted; nothing is decided in 30000 cycles",
}
COLUMNS = ("predicted to simulated", "predicted to exact orbit", "exact orbit to simulated", "engine, to simulated")
Errors = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One vehicle: growing modes, what it counts as, and the relative errors of each cycle that is said to attract.

    errors: as in `COLUMNS`, then the simulation's own by its step; nan where not compared.
    """

    vehicle: int
    tanks: int
    growing: int
    kind: str
    errors: tuple[Errors, ...]
    note: str


def vehicle(k: int) -> Case:
    """Return random vehicle k."""
    rng = np.random.default_rng([SEED, k])
    case, _ = random_case(rng)
    tanks = tuple(
        t.model_copy(
            update={"damping": PowerDamping(slope=10 ** rng.uniform(-1.5, 0.0), exponent=rng.uniform(0.5, 2.0))}
        )
        for t in case.vehicle.tanks
    )
    delay = min(float(case.autopilot.delay), LONGEST_DELAY)
    return case.model_copy(
        update={
            "vehicle": case.vehicle.model_copy(update={"tanks": tanks}),
            "autopilot": case.autopilot.model_copy(update={"delay": delay}),
        }
    )


def cycles_to_settle(omega: float, rate: float, constants: float) -> float:
    """Return the cycles that a disturbance of so slow a rate in 1/s takes to be gone."""
    return max(SHORTEST, constants * omega / (2.0 * np.pi * max(abs(rate), 1e-12)) + 25.0)


def simulated(case: Case, start: Array, omega: float, cycles: float, halves: int = 0) -> Ensemble:
    """Simulate so many cycles at half the kernel's own step, halved again as often as told."""
    step = 0.5 * SLOSH_STEP / max(float(t.frequency) for t in case.vehicle.tanks) / 2**halves
    return simulate_ensemble(case, cycles * 2.0 * np.pi / omega, start, step=step)


def apart(one: Array, other: Array) -> float:
    """Return the greatest difference of two sets of amplitudes in parts of the greatest."""
    return float(np.max(np.abs(one - other)) / np.max(other))


def amplitudes(of: Cycle | PeriodicOrbit) -> Array:
    """Return the slosh amplitudes in m, in the order of the tanks."""
    return np.array(list(of.slosh_amplitude.values()))


def widest(orbit: PeriodicOrbit) -> Array:
    """Return the slosh in m at the moment at which it is widest."""
    slosh = orbit.time_history(256).slosh
    return np.asarray(slosh[np.argmax(np.max(np.abs(slosh), axis=-1))])


def exact(case: Case, cycle: Cycle) -> PeriodicOrbit | None:
    """Return the exact orbit of a predicted cycle; None where there is none."""
    try:
        return periodic_orbit(case, cycle)
    except OutsideValidity:
        return None


def predicted(case: Case, growing: int) -> list[Cycle]:
    """Return the cycles said to attract; with several growing modes what one sinusoid would have said."""
    try:
        return [c for c in (one_sinusoid_cycles if growing > 1 else limit_cycles)(case) if c.stable]
    except OutsideValidity:
        return []


def followed(case: Case, cycle: Cycle, halve: bool) -> tuple[str, Errors, str]:
    """Return what a predicted cycle counts as, its errors, and a note where they disagree."""
    nothing = (np.nan,) * 5
    orbit = exact(case, cycle)
    if orbit is None:
        return "mistaken", nothing, "no orbit"
    if orbit.stable is not True:
        return "mistaken", nothing, f"orbit stable: {orbit.stable}, grows by {orbit.growth:.2e} 1/s"
    of_orbit = apart(amplitudes(cycle), amplitudes(orbit))
    cycles = cycles_to_settle(orbit.omega, orbit.growth, CONSTANTS)
    if cycles > LONGEST:
        note = f"the simulation would take {cycles:.0f} cycles"
        return "slow", (np.nan, of_orbit, np.nan, np.nan, np.nan), note
    run = simulated(case, START * widest(orbit), orbit.omega, cycles)
    if not run.settled:
        return "unsettled", (np.nan, of_orbit, np.nan, np.nan, np.nan), str(run.reason)
    held = apart(amplitudes(orbit), run.slosh_amplitude)
    if held > ALIKE:
        note = f"simulated {run.slosh_amplitude} m, orbit {amplitudes(orbit)} m"
        return "other", (np.nan, of_orbit, np.nan, np.nan, np.nan), note
    moved = float(run.tvc_amplitude)  # 0 where it is below what counts as rest
    engine = abs(cycle.tvc_amplitude / moved - 1.0) if moved else np.nan
    finer = simulated(case, START * widest(orbit), orbit.omega, cycles, 1) if halve else run
    by_step = apart(run.slosh_amplitude, finer.slosh_amplitude) if halve else np.nan
    return "cycle", (apart(amplitudes(cycle), run.slosh_amplitude), of_orbit, held, engine, by_step), ""


def outcome(k: int) -> Outcome:
    """Predict, balance and simulate one vehicle; every tenth also at half the step."""
    case = vehicle(k)
    poles = closed_loop_poles(open_loop(case)).value
    growing = int(np.sum((poles.real > NEUTRAL * np.abs(poles)) & (poles.imag > 0.0)))
    found = [followed(case, cycle, k % 10 == 0) for cycle in predicted(case, growing)]
    kinds = [kind for kind, _, _ in found]
    notes = [note for _, _, note in found if note]
    kind = next((one for one in KINDS if one in kinds), "")
    if kind not in ("cycle", "slow"):
        seen, note = from_small(case, poles[poles.imag > 0.0])
        kind, notes = kind or seen, [*notes, f"from small: {seen} {note}"]
    return Outcome(
        vehicle=k,
        tanks=len(case.vehicle.tanks),
        growing=growing,
        kind=kind,
        errors=tuple(errors for _, errors, _ in found),
        note="; ".join(notes),
    )


def from_small(case: Case, poles: ComplexArray) -> tuple[str, str]:
    """Return what a simulation from small slosh comes to, and in words."""
    omega = min(float(t.frequency) for t in case.vehicle.tanks)
    cycles = max(3.0 * SHORTEST, cycles_to_settle(omega, float(np.min(np.abs(poles.real))), FROM_SMALL))
    run = simulated(case, np.full(len(case.vehicle.tanks), SMALL), omega, min(cycles, LONGEST))
    if "diverged" in str(run.reason):
        return "diverges", ""
    if run.settled and np.max(run.slosh_amplitude) == 0.0:
        return "rest", ""
    if run.settled:
        return "settles", f"at {run.slosh_amplitude} m"
    return ("too slow" if cycles > LONGEST else "several"), str(run.reason)


def row(name: str, values: Array) -> str:
    """Return one line of a table of relative errors in percent."""
    values = values[np.isfinite(values)]
    if not len(values):
        return f"  {name:34s} none"
    middle, high, worst = 100.0 * np.quantile(values, [0.5, 0.95, 1.0])
    return f"  {name:34s} {len(values):4d} cycles: median {middle:.4f} %, 95 % {high:.4f} %, worst {worst:.4f} %"


def told(found: list[Outcome]) -> str:
    """Return the table: every vehicle once, then the errors."""
    lines = [f"{len(found)} random vehicles, {sum(1 for one in found if one.growing)} with a growing mode"]
    for name, low, high in (("no mode grows", 0, 0), ("one mode grows", 1, 1), ("two or more grow", 2, 99)):
        part = [one for one in found if low <= one.growing <= high]
        counts = collections.Counter(one.kind for one in part)
        lines.append(f"{name}: {len(part)} vehicles")
        lines += [f"  {counts[kind]:4d} {words}" for kind, words in KINDS.items() if counts[kind]]
        errors = np.array([x for one in part for x in one.errors]).reshape(-1, 5)
        lines += [row(what, errors[:, k]) for k, what in enumerate(COLUMNS)]
    steps = np.array([x[4] for one in found for x in one.errors])
    lines.append(row("simulation by its step", steps))
    return "\n".join(lines)


def main() -> None:
    """Follow so many vehicles and print the table."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--vehicles", type=int, default=300, help="how many, from vehicle 0 on")
    arguments.add_argument("--each", action="store_true", help="print a line for each vehicle")
    given = arguments.parse_args()
    found: list[Outcome] = []
    begun = time.process_time()
    for k in range(given.vehicles):
        one = outcome(k)
        found.append(one)
        if given.each or one.note:
            worst = max((e[1] for e in one.errors), default=np.nan)
            print(
                f"{one.vehicle:4d} {one.tanks} tanks {one.growing} grow {one.kind} {worst:.2e} {one.note}", flush=True
            )
    print(told(found))
    print(f"{(time.process_time() - begun) / 60.0:.0f} min of one core")


if __name__ == "__main__":
    main()
