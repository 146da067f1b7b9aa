"""Commands about a flight: every time of it assessed, and the growth of a slosh mode along it."""

import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import Output, Tank, figure_path, quantity, refused, save, tank_of, writable
from sloshpy.files import read_flight, write_requirement
from sloshpy.flight import (
    CarriedGrowth,
    FlightAssessment,
    FlightGrowth,
    Trajectory,
    assess_flight,
    check_growth,
    damping_requirement,
    growth_across,
    growth_along,
)

FlightFile = Annotated[Path, Parameter(help="flight file (TOML), its tables beside it")]


@app.command
def flight(
    file: FlightFile,
    *,
    linear: Annotated[
        bool, Parameter(negative="", help="leave the limit cycles out: seconds in place of minutes, and no verdict")
    ] = False,
    figures: Annotated[Path | None, Parameter(help="write every figure over flight time into this folder")] = None,
    requirement: Annotated[
        Path | None, Parameter(help="write the damping required of each tank, NAME-TANK.csv, .xlsx or .nc")
    ] = None,
    every: Annotated[
        int | None, Parameter(help="limit cycles at every so many times, and at the ends of each phase; default: all")
    ] = None,
    report: Annotated[Path | None, Parameter(help="write a self-contained HTML report")] = None,
    json: Annotated[bool, Parameter(negative="", help="print one JSON object in SI units")] = False,
    workers: Annotated[int | None, Parameter(help="processes; default: the cores of this machine")] = None,
) -> int:
    """Assess every time of a flight and print the worst of each criterion with its time.

    Exit status: 0 the criteria are met, 1 one is not (or no verdict is supported, or --linear asks for none), 2 the
    input was refused, 130 interrupted.
    """
    if every is not None and linear:
        rule = "is how often limit cycles are sought, and --linear leaves them out"
        raise refused("--every", every, rule, "leave one of them out; a longer step in the phases takes fewer times")
    if every is not None and every < 1:
        raise refused("--every", every, "must be 1 or more", "leave it out for every time")
    count = len(os.sched_getaffinity(0)) if workers is None else workers
    if not 1 <= count <= 512:
        raise refused("--workers", workers, "must be 1 to 512", "leave it out for all cores")
    if report is not None:
        writable(file, report, {".html", ".htm"})
    if figures is not None and figures.exists() and not figures.is_dir():
        raise refused("--figures", figures, "is a file", "name a folder")
    if requirement is not None:
        writable(file, requirement, {".csv", ".xlsx", ".nc"})
    try:
        result = assessed(read_flight(file), 0 if linear else every or 1, count)
    except KeyboardInterrupt:
        print("interrupted: nothing is written", file=sys.stderr)
        return 130
    print(result.to_json() if json else result)
    beside = sys.stderr if json else sys.stdout
    if requirement is not None:
        for tank in result.trajectory.tanks:
            own = requirement.with_stem(f"{requirement.stem}-{tank.replace(' ', '_')}")
            print(f"table: {write_requirement(damping_requirement(result, tank), own)}", file=beside)
    if figures is not None:
        from sloshpy.report import write_flight_figures  # matplotlib: only when something is drawn

        for path in write_flight_figures(result, figures):
            print(f"figure: {path}", file=beside)
    if report is not None:
        from sloshpy.report import write_flight_report  # as above

        print(f"report: {write_flight_report(result, report)}", file=beside)
    return 0 if result.verdict == "pass" else 1


@app.command
def flight_growth(
    file: FlightFile,
    *,
    phase: Annotated[str | None, Parameter(help="stay in the phase of this name; default: on across events")] = None,
    tank: Tank = None,
    amplitude: Annotated[str, Parameter(help="slosh at the start")] = "0.01 m",
    start: Annotated[
        str | None, Parameter(help="time of flight at the start; default: where phase or flight begins")
    ] = None,
    end: Annotated[str | None, Parameter(help="time at the end; default: where phase or flight ends")] = None,
    output: Output = None,
) -> int:
    """Print how a slosh mode grows along a flight, and draw it against the nonlinear simulation.

    It goes on across an event that leaves vehicle and liquid as they are, and ends at any other with the reason.
    """
    from sloshpy import plots  # matplotlib: only when something is drawn

    trajectory, path = read_flight(file), figure_path(file, output, "growth")
    names, size = [one.name for one in trajectory], quantity("--amplitude", amplitude, "m")
    if phase is not None and phase not in names:
        raise refused("--phase", phase, "is no phase of the flight", f"one of {', '.join(names)}")
    first, last = (
        None if text is None else quantity(option, text, "s") for option, text in (("--start", start), ("--end", end))
    )
    growth: FlightGrowth | CarriedGrowth
    if phase is not None:
        own = trajectory.phases[names.index(phase)]
        growth = growth_along(own, tank_of(own.case, tank), size, first, last)
    else:
        begins = trajectory.phase_at(float(trajectory.phases[0].time[0]) if first is None else first)
        growth = growth_across(trajectory, tank_of(begins.case, tank), size, first, last)
    check = check_growth(growth)
    print(check)
    return save(plots.plot_growth_check(check), path)


FEWEST = 12  # times that are worth the start of worker processes, a second or two


def assessed(trajectory: Trajectory, cycles: int, workers: int) -> FlightAssessment:
    """Assess a flight with a progress bar on standard error, where that is a terminal."""
    from rich.console import Console  # 0.1 s
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(trajectory.name[:40], total=None)

        def progress(done: int, total: int, what: str) -> None:
            bar.update(task, completed=done, total=total, description=what)

        return assess_flight(trajectory, cycles, progress, workers if trajectory.count >= FEWEST else 0)
