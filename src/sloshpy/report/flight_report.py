"""The review of a flight as one self-contained HTML page, the same bytes for the same flight."""

import importlib.metadata
import os
from pathlib import Path

import jinja2

from sloshpy.files.write import write_whole
from sloshpy.flight import FlightAssessment, damping_requirement
from sloshpy.report.flight_figures import flight_figures
from sloshpy.report.flight_tables import (
    event_table,
    phase_inputs,
    phase_table,
    requirement_table,
    window_table,
    worst_table,
)
from sloshpy.report.report import METHOD, assumptions, shown

OF_FLIGHT = (
    "Each time is a loop of its own, all that changes frozen at its moment; what the change itself does to an "
    "oscillation (the adiabatic term) enters the growth along the flight and its simulation, not the margins.",
    "Nothing is interpolated across an event. Between the rows of a table a quantity is linear or monotone cubic, as "
    "declared.",
    "Growth factors of windows hold at small amplitude; from a chosen amplitude on the growth along the flight counts "
    "the damping that grows with it.",
)
FLIGHT_METHOD = (
    *METHOD,
    (
        "Growth along the flight",
        "da/dt = (sigma(a, t) + alpha(t)) a, sigma of the frozen loop, alpha the adiabatic term",
    ),
    ("Required damping", "of one tank, the others held where all tanks together meet the criterion"),
)


def write_flight_report(result: FlightAssessment, path: str | os.PathLike[str]) -> Path:
    """Write the report of a flight as one HTML file that needs nothing from outside, whole or not at all.

    Args:
        result: of `assess_flight`. path: the HTML file.
    """
    target = Path(path)
    write_whole(target, flight_report_html(result).encode())
    return target


def flight_report_html(result: FlightAssessment) -> str:
    """Return the report of a flight as a text."""
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    pages = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    phases = result.trajectory.phases
    said = dict.fromkeys(f"{line}" for phase in phases for line in assumptions(phase.case))
    return pages.get_template("flight.html").render(
        r=result,
        verdict={"linear": "no verdict"}.get(result.verdict, result.verdict),
        version=importlib.metadata.version("sloshpy"),
        tables=[worst_table(result), window_table(result), phase_table(result), event_table(result)],
        figures=[shown(k, figure) for k, figure in enumerate(flight_figures(result))],
        requirements=[requirement_table(damping_requirement(result, tank)) for tank in result.trajectory.tanks],
        inputs=[phase_inputs(phase) for phase in phases],
        assumptions=[*said, *OF_FLIGHT, *_cautions(result)],
        method=FLIGHT_METHOD,
    )


def _cautions(result: FlightAssessment) -> list[str]:
    """Return what the reviews of single times caution against, each once with its first time."""
    first: dict[str, str] = {}
    for review in result.reviews:
        for time, one in zip(review.time, review.assessments, strict=True):
            for reason in one.reasons if one is not None else ():
                if "caution" in reason or "not checked" in reason:
                    key = reason.split(":")[0] + reason.split(":")[1] if reason.count(":") else reason
                    first.setdefault(key, f"Raised first at {time:g} s: {reason}")
    return list(first.values())
