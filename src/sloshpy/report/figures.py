"""All figures of an assessment, in the paper's order: for the report and for a folder of files."""

import functools
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sloshpy.assess import Assessment, TankReview
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import LimitCycle, degradation_map, growth_curve
from sloshpy.plots import (
    plot_bode,
    plot_damping_law,
    plot_damping_sweep,
    plot_danger_zone,
    plot_danger_zones,
    plot_degradation_map,
    plot_growth,
    plot_limit_cycle,
    plot_nichols,
    plot_root_locus,
    plot_time_history,
    plot_tvc_gain,
    save_figure,
)
from sloshpy.plots.save import Drawn
from sloshpy.simulation import simulate_degraded
from sloshpy.stability import (
    DampingSweep,
    RequiredDampingMap,
    damping_law_curve,
    damping_sweep,
    disc_margin_curve,
    required_damping_map,
    root_locus,
)

UNTRUSTED = "poles and encirclement count disagree, or the sampler folds: no figure that rests on the margins is drawn"


@dataclass(frozen=True, kw_only=True)
class ReportFigure:
    """One figure of an assessment, drawn when asked for.

    number: of the paper's figure it answers to, "" where the paper has none. tank: "" for the whole loop.
    stem: file name without suffix. missing: why it cannot be drawn, "" where it can; known before drawing.
    draw: returns Axes; may raise OutsideValidity where a number in it is not supported.
    """

    number: str
    title: str
    tank: str
    caption: str
    stem: str
    draw: Callable[[], Drawn]
    missing: str = ""


def figures(assessment: Assessment, full: bool = False) -> list[ReportFigure]:
    """Return every figure of an assessment: the loop's first, then each tank's, the time history last.

    full: with those that take their time, the danger zones of all tanks together and the degradation map.
    """
    case = assessment.case

    @functools.cache
    def zone(j: int) -> RequiredDampingMap:
        return required_damping_map(case, j)

    found = [
        ReportFigure(
            number="4",
            title="Root locus",
            tank="",
            caption="Closed-loop poles over the loop gain without slosh damping. With one tank and a plain PD law a "
            "slosh pole below its zero is driven into the unstable half, one above it is not; lag and other tanks may "
            "turn that.",
            stem="fig4_root_locus",
            draw=lambda: plot_root_locus(root_locus(case)),
        )
    ]
    for j, tank in enumerate(assessment.tanks):
        found += _of_tank(assessment, j, tank, zone)
    worst = leading_limit_cycle(assessment)
    if full:
        found += _in_full(assessment, worst, zone)
    found.append(
        ReportFigure(
            number="9",
            title="Time history of the degraded loop",
            tank=worst.tank,
            caption="Nonlinear simulation with the tanks' own damping laws, the loop degraded by the gain and delay of "
            f"the {worst.tank} limit cycle.",
            stem="fig9_time_history",
            draw=lambda: plot_time_history(simulate_degraded(worst)),
        )
    )
    return found


def _in_full(
    assessment: Assessment, worst: LimitCycle, zone: Callable[[int], RequiredDampingMap]
) -> list[ReportFigure]:
    case = assessment.case
    untrusted = "" if assessment.margins.trusted else UNTRUSTED
    drawn = [
        ReportFigure(
            number="",
            title="Degradation map",
            tank=worst.tank,
            caption="Engine amplitude of the limit cycle that extra gain and delay would leave, the disc margin in it "
            "and the point of figure 8.",
            stem="degradation_map",
            draw=lambda: plot_degradation_map(degradation_map(case, worst.tank)),
            missing=untrusted,
        )
    ]
    if len(assessment.tanks) > 1:
        zones = ReportFigure(
            number="",
            title="Danger zones of all tanks",
            tank="",
            caption="Damping each tank would need at each station of the vehicle, and where it is.",
            stem="danger_zones",
            draw=lambda: plot_danger_zones([zone(j) for j in range(len(assessment.tanks))]),
            missing=untrusted,
        )
        drawn.insert(0, zones)
    return drawn


def leading_limit_cycle(assessment: Assessment) -> LimitCycle:
    """Return the predicted limit cycle with the greatest engine amplitude; the first tank's where none has one."""
    cycles = [tank.limit_cycle for tank in assessment.tanks]
    return max(cycles, key=lambda c: c.tvc_amplitude[1] if np.isfinite(c.tvc_amplitude[1]) else -np.inf)


def _of_tank(
    assessment: Assessment, j: int, tank: TankReview, zone: Callable[[int], RequiredDampingMap]
) -> list[ReportFigure]:
    case, name, cycle = assessment.case, tank.name, tank.limit_cycle
    required = cycle.together

    @functools.cache
    def sweep() -> DampingSweep:
        return damping_sweep(case, tank=j, required=required)

    untrusted = "" if assessment.margins.trusted else UNTRUSTED
    several = "" if assessment.cycles is not None else "one sinusoid predicts no limit cycle here, see the reasons"
    no_cycle = "" if np.all(np.isfinite(cycle.tvc_amplitude)) else "; ".join(cycle.reasons)
    rows: list[tuple[str, str, str, str, Callable[[], Drawn], str]] = [
        ("", "Danger zone", "danger_zone", "Damping the tank would need at each station, and the closed-form danger "
         "zone (eqs 22 and 23); the dot is the tank where it is.",
         lambda: plot_danger_zone(zone(j)), untrusted),
        ("5", "Bode diagram", "bode", "Open loop, broken at the engine command, at several dampings of this tank.",
         lambda: plot_bode(sweep()), ""),
        ("6", "Nichols diagram", "nichols", "The open loop about the critical point (+); a curve through the grey disc "
         "falls short of the wanted margins (eq 24).", lambda: plot_nichols(sweep()), untrusted),
        ("", "Disc margin over damping", "disc_margin", "The tank's own disc margin, negative where the loop is "
         "unstable.", lambda: plot_damping_sweep(disc_margin_curve(case, tank=j, required=required)), untrusted),
        ("7", "Slosh per engine angle", "tvc_gain", "A property of the plant alone: the more slosh per engine angle, "
         "the smaller the engine motion of a limit cycle.", lambda: plot_tvc_gain(sweep()), ""),
        ("", "Damping law", "damping_law", "Damping of the tank over its slosh amplitude against what the loop needs.",
         lambda: plot_damping_law(damping_law_curve(case, required)), untrusted),
        ("8", "Predicted limit cycle", "limit_cycle", "Engine amplitude over the slosh-related band if gain and phase "
         "were degraded by the whole margin; dashed is the paper's convention, which reads the damping at the slosh "
         "frequency.", lambda: plot_limit_cycle(cycle), untrusted or no_cycle),
        ("", "Growth over amplitude", "growth", "Growth of the slosh mode in the loop as given; where it falls through "
         "zero the oscillation settles.", lambda: plot_growth(growth_curve(case, j), assessment.cycles or ()),
         untrusted or several),
    ]  # fmt: skip
    suffix = "" if len(assessment.tanks) == 1 else "_" + name.replace(" ", "_")
    return [
        ReportFigure(
            number=number,
            title=title,
            tank=name,
            caption=caption,
            stem=f"fig{number}_{stem}{suffix}" if number else f"{stem}{suffix}",
            draw=draw,
            missing=missing,
        )
        for number, title, stem, caption, draw, missing in rows
    ]


def write_figures(
    assessment: Assessment, folder: str | os.PathLike[str], suffix: str = "png", full: bool = False
) -> list[Path]:
    """Write every figure of an assessment that can be drawn into a folder, which is made where it is not there.

    Args:
        assessment: result of `assess`.
        folder: for the files, named by the paper's figure number and what they show.
        suffix: "png", "svg" or "pdf".
        full: as in `figures`.

    Returns:
        The files written, in order.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    written = []
    for figure in figures(assessment, full):
        if figure.missing:
            continue
        try:
            drawn = figure.draw()
        except OutsideValidity:  # the report says which and why
            continue
        written.append(save_figure(drawn, target / f"{figure.stem}.{suffix}"))
    return written
