"""All figures of a flight, written into a folder."""

import os
from collections.abc import Callable
from pathlib import Path

from sloshpy.flight import FlightAssessment
from sloshpy.plots import (
    plot_flight_cycles,
    plot_flight_damping,
    plot_flight_danger_zone,
    plot_flight_frequencies,
    plot_flight_growth,
    plot_flight_margins,
    save_figure,
)
from sloshpy.plots.save import Drawn

_FIGURES: dict[str, Callable[[FlightAssessment], Drawn]] = {
    "disc_margin": plot_flight_margins,
    "damping": plot_flight_damping,
    "danger_zone": plot_flight_danger_zone,
    "limit_cycles": plot_flight_cycles,
    "frequencies": plot_flight_frequencies,
    "growth": plot_flight_growth,
}


def write_flight_figures(result: FlightAssessment, folder: str | os.PathLike[str], suffix: str = "png") -> list[Path]:
    """Write every figure of a flight into a folder, which is made where it is not there; return the files.

    The figure of the limit cycles is left out where none were asked for.

    Args:
        result: of `assess_flight`. folder: for the files. suffix: "png", "svg" or "pdf".
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    wanted = {name: draw for name, draw in _FIGURES.items() if result.cycles or name != "limit_cycles"}
    return [save_figure(draw(result), target / f"flight_{name}.{suffix}") for name, draw in wanted.items()]
