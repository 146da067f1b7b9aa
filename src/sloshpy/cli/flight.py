"""Commands about a flight: every time of it assessed."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import refused, writable
from sloshpy.files import read_flight, write_requirement
from sloshpy.flight import FlightAssessment, Trajectory, assess_flight, damping_requirement

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
    every: Annotated[int, Parameter(help="limit cycles at every so many times, and at the ends of each phase")] = 1,
) -> int:
    """Assess every time of a flight and print the worst of each criterion with its time."""
    if every < 1:
        raise refused("--every", every, "must be 1 or more", "leave it out for every time")
    if figures is not None and figures.exists() and not figures.is_dir():
        raise refused("--figures", figures, "is a file", "name a folder")
    if requirement is not None:
        writable(file, requirement, {".csv", ".xlsx", ".nc"})
    result = assessed(read_flight(file), 0 if linear else every)
    print(result)
    if requirement is not None:
        for tank in result.trajectory.tanks:
            own = requirement.with_stem(f"{requirement.stem}-{tank.replace(' ', '_')}")
            print(f"table: {write_requirement(damping_requirement(result, tank), own)}")
    if figures is not None:
        from sloshpy.report import write_flight_figures  # matplotlib: only when something is drawn

        for path in write_flight_figures(result, figures):
            print(f"figure: {path}")
    return 0 if result.verdict in {"pass", "linear"} else 1


def assessed(trajectory: Trajectory, cycles: int) -> FlightAssessment:
    """Assess a flight with a progress bar on standard error, where that is a terminal."""
    from rich.console import Console  # 0.1 s
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(trajectory.name[:40], total=None)

        def progress(done: int, total: int, what: str) -> None:
            bar.update(task, completed=done, total=total, description=what)

        return assess_flight(trajectory, cycles, progress)
