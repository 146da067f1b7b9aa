"""An assessment as one self-contained HTML page, the same bytes for the same case."""

import importlib.metadata
import os
import re
from dataclasses import dataclass
from pathlib import Path

import jinja2

from sloshpy.assess import Assessment
from sloshpy.case import Case
from sloshpy.errors import OutsideValidity
from sloshpy.files.write import write_whole
from sloshpy.plots import figure_bytes
from sloshpy.report.figures import ReportFigure, figures
from sloshpy.report.inputs import input_rows
from sloshpy.report.tables import (
    by_mode_table,
    criteria_table,
    crossing_table,
    cycle_table,
    mode_table,
    orbit_table,
    sensitivity_table,
    tank_table,
)

METHOD = (
    ("Equations of motion", "eqs 1 to 12, with the signs that make the mass matrix symmetric"),
    ("Control law", "eq 13, sign such that the loop is closed by negative feedback"),
    ("Damping laws and their describing functions", "eqs 14 to 20"),
    ("Danger zone", "eqs 21 to 23, for any ratio of vectored to total thrust"),
    ("Disc margin", "eq 24; its sign here says stable or unstable, by poles and by encirclement count"),
    ("Limit cycle", "the five steps of section C.3; amplitudes also at the cycle's own frequency"),
)


@dataclass(frozen=True, kw_only=True)
class _Shown:
    """A figure on the page: its SVG, or the reason in its place."""

    figure: ReportFigure
    svg: str
    reason: str


def write_report(assessment: Assessment, path: str | os.PathLike[str], full: bool = False) -> Path:
    """Write the report of an assessment as one HTML file that needs nothing from outside, whole or not at all.

    The same case gives the same bytes; no date is written.

    Args:
        assessment: result of `assess`.
        path: the HTML file.
        full: with what takes its time: exact orbits, degradation map, the danger zones of all tanks together.
    """
    if isinstance(assessment, Case):  # the slip that everyone makes once
        raise TypeError("write_report takes an assessment, not a case: write_report(assess(case), path)")
    target = Path(path)
    write_whole(target, report_html(assessment, full).encode())
    return target


def report_html(assessment: Assessment, full: bool = False) -> str:
    """Return the report as a text; `full` as in `write_report`."""
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    pages = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    trusted, m = assessment.margins.trusted, assessment.margins
    loop = [mode_table(assessment), by_mode_table(assessment), crossing_table(m, assessment.read_at)] if trusted else []
    loop += [sensitivity_table(assessment), cycle_table(assessment)] if trusted else []
    loop += [orbit_table(assessment)] if trusted and full else []
    return pages.get_template("template.html").render(
        a=assessment,
        version=importlib.metadata.version("sloshpy"),
        tables=[criteria_table(assessment), *([] if m.folded else [tank_table(assessment)]), *loop],
        figures=[shown(k, figure) for k, figure in enumerate(figures(assessment, full))],
        inputs=input_rows(assessment.case),
        cautions=[reason for reason in assessment.reasons if "caution" in reason or "not checked" in reason],
        assumptions=assumptions(assessment.case),
        method=METHOD,
    )


def assumptions(case: Case) -> list[str]:
    """Return what the numbers of a case take for granted, worded for the parts it has."""
    v = case.vehicle
    body = (
        f"The vehicle is a body with {len(v.flexible_modes)} bending modes, slosh masses frozen in them, on vectored "
        "thrust that follows its rigid axis"
        if v.flexible_modes
        else "The vehicle is a rigid body on vectored thrust"
    )
    engine = "the inertia of the swivelling engine counts" if v.engine else "the engine has no inertia"
    air = "the air acts by a quasi-steady normal force" if v.aerodynamics else "there is no aerodynamic force"
    return [
        f"{body}, seen in one plane; {engine}; {air}.",
        "Angles are small, mass properties and acceleration are frozen at one flight time.",
        "Each tank is one spring-mass-damper, its first lateral slosh mode: good to slosh amplitudes of 10 to 15 % of "
        "the tank radius.",
        "Damping depends on the speed of the slosh mass alone, by each law; no law is read beyond its data.",
        "A limit cycle is predicted as one sinusoid (describing function); beating of several modes needs simulation.",
    ]


def shown(number: int, figure: ReportFigure) -> _Shown:
    """Return a figure as it stands on the page, drawn as SVG, or the reason why there is none."""
    if figure.missing:
        return _Shown(figure=figure, svg="", reason=figure.missing)
    try:
        drawn = figure.draw()
    except OutsideValidity as error:
        return _Shown(figure=figure, svg="", reason=str(error))
    return _Shown(figure=figure, svg=inline(figure_bytes(drawn, "svg", salt=f"sloshpy {number}").decode()), reason="")


def inline(svg: str) -> str:
    """Return an SVG file as an element of a page: no prologue, no group names that would repeat on the page."""
    element = svg[svg.index("<svg") :]
    return re.sub(r'<g id="[^"]*"', "<g", element)
