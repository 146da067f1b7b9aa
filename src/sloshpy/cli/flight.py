"""Commands about a flight: every time of it assessed."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import refused
from sloshpy.files import read_flight
from sloshpy.flight import FlightAssessment, Trajectory, assess_flight

FlightFile = Annotated[Path, Parameter(help="flight file (TOML), its tables beside it")]


@app.command
def flight(
    file: FlightFile,
    *,
    linear: Annotated[
        bool, Parameter(negative="", help="leave the limit cycles out: seconds in place of minutes, and no verdict")
    ] = False,
    every: Annotated[int, Parameter(help="limit cycles at every so many times, and at the ends of each phase")] = 1,
) -> int:
    """Assess every time of a flight and print the worst of each criterion with its time."""
    if every < 1:
        raise refused("--every", every, "must be 1 or more", "leave it out for every time")
    result = assessed(read_flight(file), 0 if linear else every)
    print(result)
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
