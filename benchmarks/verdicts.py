"""Whole assessments against a second implementation of the equations, on random vehicles.

1 to 4 tanks with power laws, 0 to 3 bending modes, engine inertia, air, filters, actuators, delays. Every minimum,
required damping, limit cycle and the verdict of `assess` are put into the equations that `tests/oracle_verdict.py`
writes anew. Prints how often each was compared and every disagreement; exits 1 if there is one.

    OPENBLAS_NUM_THREADS=1 python benchmarks/verdicts.py --vehicles 2000
"""

import argparse
import json
import multiprocessing
import sys
import time
import warnings
from collections import Counter
from pathlib import Path

from sloshpy import assess
from sloshpy.stability import joint_damping

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import oracle_verdict
from cases import lawful_case

SEED = 97


def checked(number: int) -> tuple[int, list[str], Counter[str]]:
    """Assess one vehicle and compare; what differs, and how much was compared."""
    warnings.simplefilter("ignore")  # the second implementation divides by zero at a zero of L
    tally = oracle_verdict.tally()
    case = lawful_case(SEED, number)
    review = json.loads(assess(case).to_json())
    return number, oracle_verdict.compare(case, review, joint_damping(case), tally), tally


def main() -> None:
    """Compare so many vehicles on so many processes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="number of the first vehicle")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    total: Counter[str] = Counter()
    differ = 0
    start = time.perf_counter()
    with multiprocessing.get_context("spawn").Pool(options.workers) as pool:
        numbers = range(options.first, options.first + options.vehicles)
        for number, bad, tally in pool.imap_unordered(checked, numbers, chunksize=4):
            total += tally
            differ += bool(bad)
            if bad:
                print(f"vehicle {number}: {', '.join(bad)}", flush=True)
    print(f"{options.vehicles} vehicles in {time.perf_counter() - start:.0f} s, {differ} with a disagreement")
    for what, count in sorted(total.items()):
        print(f"{count:8d}  {what}")
    if differ:
        sys.exit(1)


if __name__ == "__main__":
    main()
