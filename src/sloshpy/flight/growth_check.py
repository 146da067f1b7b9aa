"""A growth along a flight against the nonlinear simulation of the varying vehicle, from the mode's own state."""

from dataclasses import dataclass

import numpy as np

from sloshpy.errors import OutsideValidity
from sloshpy.flight.flight_history import FlightHistory
from sloshpy.flight.growth_across import CarriedGrowth
from sloshpy.flight.growth_along import FlightGrowth
from sloshpy.flight.mode_state import mode_command, mode_state
from sloshpy.flight.simulate_flight import simulate_flight
from sloshpy.units import Array, compared


@dataclass(frozen=True, kw_only=True)
class GrowthCheck:
    """A growth against its simulation.

    time: (P,), s, of the peaks of the simulated slosh. simulated, least, predicted: (P,), m; least is that of
    `CarriedGrowth.lower`, the same as predicted before the first event.
    """

    growth: CarriedGrowth
    history: FlightHistory
    time: Array
    simulated: Array
    least: Array
    predicted: Array

    @property
    def difference(self) -> Array:
        """Simulated over predicted amplitude less 1, (P,); 0 between the least and the greatest after an event."""
        above, below = self.simulated / self.predicted - 1.0, self.simulated / self.least - 1.0
        return np.asarray(np.where(above > 0.0, above, np.where(below < 0.0, below, 0.0)))

    @property
    def worst(self) -> float:
        """Greatest difference by size."""
        return float(np.max(np.abs(self.difference)))

    def __str__(self) -> str:
        end = f", {self.history.stopped}" if self.history.stopped else ""
        apart = compared(self.worst, "the predicted amplitude")
        span = f"{self.least[-1]:.4g} to " if self.growth.carries else ""
        return (
            f"{self.growth}\n  simulated {self.simulated[-1]:.4g} m at {self.time[-1]:.2f} s, predicted "
            f"{span}{self.predicted[-1]:.4g} m there; they differ by {apart} at most{end}"
        )


def check_growth(growth: FlightGrowth | CarriedGrowth, step: float | None = None, angle: float = 0.0) -> GrowthCheck:
    """Simulate a growth from its own mode and return how far the amplitudes differ.

    Args:
        growth: of `growth_along` or `growth_across`. step: s, at most, of the simulation.
        angle: where in its swing the mode starts, rad, and so where in it an event finds the slosh.
    """
    if isinstance(growth, FlightGrowth):
        growth = CarriedGrowth(parts=(growth,), lower=(growth,), carries=(), ended="")
    first, last = growth.parts[0], growth.parts[-1]
    phases = [part.phase for part in growth.parts]
    ends = float(first.time[0]), float(last.time[-1])
    history = simulate_flight(phases, mode_state(first, angle), *ends, step, mode_command(first, angle))
    time, simulated = history.peaks(first.phase.tanks.index(growth.tank))
    least, predicted = growth.at(time)
    kept = np.isfinite(predicted)
    if not np.any(kept):
        raise OutsideValidity("the simulation has no whole swing to compare")
    return GrowthCheck(
        growth=growth,
        history=history,
        time=time[kept],
        simulated=simulated[kept],
        least=least[kept],
        predicted=predicted[kept],
    )
