"""Error of the one-sinusoid limit cycle against the exact periodic orbit, on random vehicles with 1 to 4 tanks.

Power laws of exponent 0.5 to 2, delays to 0.2 s, actuators, filters; vehicle k is the same however many are asked for:

    OPENBLAS_NUM_THREADS=1 python benchmarks/limit_cycles.py --vehicles 300

A vehicle counts where at least one oscillation grows at small amplitude and a one-sinusoid cycle attracts. The exact
orbit is itself held against simulations to 1e-5 in tests/test_periodic_orbit.py. The error is the greatest difference
of the slosh amplitudes in parts of the greatest amplitude. Where several modes grow at once `limit_cycles` refuses;
what it would have said is compared all the same.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sloshpy.case import Case
from sloshpy.damping import PowerDamping
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import Cycle, PeriodicOrbit, periodic_orbit
from sloshpy.limit_cycle.cycles import one_sinusoid_cycles

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from cases import random_case

SEED = 25
LONGEST_DELAY = 0.2  # s


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One vehicle: how many modes grow, and the relative errors of its cycles against attracting orbits."""

    growing: int
    errors: tuple[float, ...]
    without_orbit: int  # one-sinusoid cycles said to attract whose exact orbit repels or is not there


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


def error(cycle: Cycle, orbit: PeriodicOrbit) -> float:
    """Return the greatest difference of the slosh amplitudes in parts of the greatest amplitude."""
    exact = orbit.slosh_amplitude
    return max(abs(cycle.slosh_amplitude[name] - a) for name, a in exact.items()) / max(exact.values())


def outcome(case: Case) -> Outcome | None:
    """Compare every attracting one-sinusoid cycle of a vehicle; None where nothing grows or no cycle attracts."""
    poles = closed_loop_poles(open_loop(case)).value
    growing = int(np.sum((poles.real > NEUTRAL * np.abs(poles)) & (poles.imag > 0.0)))
    if not growing:
        return None
    errors, without = [], 0
    try:
        cycles = [cycle for cycle in one_sinusoid_cycles(case) if cycle.stable]
    except OutsideValidity:
        cycles = []
    for cycle in cycles:
        try:
            orbit = periodic_orbit(case, cycle)
        except OutsideValidity:
            without += 1
            continue
        if orbit.stable:
            errors.append(error(cycle, orbit))
        else:
            without += 1
    return Outcome(growing=growing, errors=tuple(errors), without_orbit=without) if cycles else None


def told(name: str, found: list[Outcome]) -> str:
    """Return one line of the table."""
    errors = np.array([x for one in found for x in one.errors])
    without = sum(one.without_orbit for one in found)
    if not errors.size:
        return f"{name:22s} {len(found):4d} vehicles, no attracting orbit, {without} cycles without one"
    median, high, worst = 100.0 * np.quantile(errors, [0.5, 0.95, 1.0])
    return (
        f"{name:22s} {len(found):4d} vehicles, {errors.size} attracting orbits: error median {median:.4f} %, "
        f"95th percentile {high:.3f} %, worst {worst:.2f} %; {without} cycles without one: simulate"
    )


def main() -> None:
    """Run so many vehicles and print the table."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--vehicles", type=int, default=300, help="vehicles with a limit cycle")
    wanted = arguments.parse_args().vehicles
    found: list[Outcome] = []
    k = 0
    while len(found) < wanted:
        one = outcome(vehicle(k))
        found += [one] if one is not None else []
        k += 1
    print(f"{k} random vehicles, {len(found)} with an attracting one-sinusoid cycle")
    print(told("one mode grows", [one for one in found if one.growing == 1]))
    print(told("two or more grow", [one for one in found if one.growing > 1]))


if __name__ == "__main__":
    main()
