"""The demonstration of fig 9: a loop degraded by the whole margin of one tank, simulated with the tank's own law."""

import math

from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import LimitCycle
from sloshpy.simulation.simulate import TimeHistory, simulate

CYCLES = 70  # of the predicted oscillation: the paper's 200 s of its example


def simulate_degraded(limit_cycle: LimitCycle) -> TimeHistory:
    """Simulate the loop degraded by the gain and delay of a predicted limit cycle, until it can have settled.

    Raises:
        OutsideValidity: no limit cycle is predicted, the degradation is a phase advance, which no delay makes, or the
            damping data do not start at 0 m.
    """
    c = limit_cycle
    case = c.case
    if not c.omega > 0.0:
        raise OutsideValidity(f"{c.tank}: {'; '.join(c.reasons)}")
    if c.delay < 0.0:
        raise OutsideValidity(
            f"{c.tank}: the loop becomes neutral by a phase advance of {-1e3 * c.delay:.1f} ms, which is no delay and "
            "cannot be simulated"
        )
    degraded = case.model_copy(update={"autopilot": case.autopilot.degraded(c.gain, c.delay)})
    return simulate(degraded, duration=CYCLES * 2.0 * math.pi / c.omega)
