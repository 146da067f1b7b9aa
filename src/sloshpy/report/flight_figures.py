"""All figures of a flight, for its report and for a folder of files."""

import contextlib
import functools
import os
from collections.abc import Callable
from pathlib import Path

from sloshpy.errors import OutsideValidity
from sloshpy.flight import FlightAssessment, check_growth, growth_along
from sloshpy.plots import (
    plot_flight_cycles,
    plot_flight_damping,
    plot_flight_danger_zone,
    plot_flight_frequencies,
    plot_flight_growth,
    plot_flight_margins,
    plot_growth_check,
    save_figure,
)
from sloshpy.plots.save import Drawn
from sloshpy.report.figures import ReportFigure

START = 0.001  # m of slosh, at which the growth that is shown starts


def flight_figures(result: FlightAssessment) -> list[ReportFigure]:
    """Return every figure of a flight, the deciding ones first."""
    asked = "" if result.cycles else "limit cycles were not asked for"
    figures: list[tuple[str, str, Callable[[FlightAssessment], Drawn], str, str]] = [
        ("limit_cycles", "Limit cycles against their limits", plot_flight_cycles, asked,
         "Slosh and engine amplitude that the degraded loop runs into, by the five steps and with all tanks coupled. "
         "Slosh limit: 15 % of the tank radius, beyond which the model ends; engine limit: the criterion."),
        ("disc_margin", "Disc margin by mode", plot_flight_margins, "",
         "Eq 24 at small amplitude. Of a slosh mode it sets the required damping, of any other it is a criterion."),
        ("damping", "Damping required and available", plot_flight_damping, "",
         "Required: the least for the criterion, the other tanks held where all together meet it. Available: by the "
         "tank's law at a tenth of its radius."),
        ("danger_zone", "Danger zone", plot_flight_danger_zone, "",
         "Eqs 22 and 23: between the aft bound and the centre of percussion a slosh mass needs damping."),
        ("growth", "Time to double and growth of each window", plot_flight_growth, "",
         "At small amplitude. A window begins and ends where the growth crosses zero; its begin is the worst start."),
        ("frequencies", "Frequencies of control, slosh and bending", plot_flight_frequencies, "",
         "Closed-loop modes, each named by what takes part most."),
    ]  # fmt: skip

    found = [
        ReportFigure(
            number="",
            title=title,
            tank="",
            caption=caption,
            stem=f"flight_{stem}",
            draw=functools.partial(draw, result),
            missing=missing,
        )
        for stem, title, draw, missing, caption in figures
    ]
    return [*found, _of_growth(result)]


def _of_growth(result: FlightAssessment) -> ReportFigure:
    """Return the growth of the slosh mode that grows most, from a hundredth of a metre, against its simulation."""
    slosh = [
        (w, tank)
        for w in result.windows
        for tank in result.trajectory.tanks
        if w.mode.split(", then ")[0] == f"{tank} slosh"
    ]

    def draw() -> Drawn:
        window, tank = slosh[0]
        phase = next(p for p in result.trajectory if p.name == window.phase)
        return plot_growth_check(check_growth(growth_along(phase, tank, START, window.start, window.end)))

    return ReportFigure(
        number="",
        title="Growth along the flight against simulation",
        tank="",
        caption=f"From {START:g} m at the worst start: the amplitude by da/dt = (sigma + alpha) a, and the slosh of "
        "the nonlinear simulation in which mass, thrust, fill, frequencies and gains change.",
        stem="flight_growth_check",
        draw=draw,
        missing="" if slosh else "no slosh mode grows at small amplitude",
    )


def write_flight_figures(result: FlightAssessment, folder: str | os.PathLike[str], suffix: str = "png") -> list[Path]:
    """Write every figure of a flight into a folder, which is made where it is not there; return the files.

    What cannot be drawn is left out: limit cycles that were not asked for, growth where nothing grows.

    Args:
        result: of `assess_flight`. folder: for the files. suffix: "png", "svg" or "pdf".
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    written = []
    for figure in flight_figures(result):
        with contextlib.suppress(OutsideValidity):
            if not figure.missing:
                written.append(save_figure(figure.draw(), target / f"{figure.stem}.{suffix}"))
    return written
