"""Commands about inputs: tanks, checks, schema, examples."""

import json
from json import dumps
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import CaseFile, Output, drawn, figure_path, refused, writable
from sloshpy.files import (
    case_schema,
    example_dispersion_names,
    example_flight_names,
    example_names,
    example_record_names,
    example_tank_names,
    read_case,
    read_fill_table,
    read_tank,
    tank_schema,
    write_example,
    write_fill_history,
)
from sloshpy.tank import slosh_masses, slosh_masses_history, tank_damping


@app.command(name="tank")
def tank_command(
    file: Annotated[Path, Parameter(help="tank file (TOML)")],
    *,
    json: Annotated[
        bool, Parameter(negative="", help="print one JSON object in SI units; no figure unless named")
    ] = False,
    history: Annotated[
        Path | None, Parameter(help="CSV with fill [%] or depth [m], and acceleration and time where they change")
    ] = None,
    table: Annotated[Path | None, Parameter(help="where the history's table goes: .csv, .xlsx or .nc")] = None,
    damping_figure: Annotated[
        Path | None, Parameter(help="draw the damping over the amplitude too: .png, .svg or .pdf")
    ] = None,
    output: Output = None,
) -> int:
    """Print the slosh masses of a tank from its shape and fill, and draw its section (fig 1)."""
    read = read_tank(file)
    path = None if json and output is None else figure_path(file, output, "tank" if history is None else "history")
    if table is not None:
        if history is None:
            raise refused("--table", table, "needs --history", "name the CSV of the fills")
        writable(file, table, {".csv", ".xlsx", ".nc"})
    if damping_figure is not None:
        if history is not None:
            raise refused("--damping-figure", damping_figure, "stands beside --history", "leave one of them out")
        damping_figure = figure_path(file, damping_figure, "damping")
    if history is None:
        found = slosh_masses(read)
        damping = tank_damping(found)
        if damping_figure is not None and not damping.known:
            why = "; ".join(damping.reasons) or "neither viscosity nor ring baffle nor damping_floor is given"
            raise refused("--damping-figure", damping_figure, f"has nothing to show: {why}", "give one of them")
        print(
            dumps(found.to_dict() | damping.to_dict(), indent=1)
            if json
            else "\n".join(filter(None, map(str, (found, damping))))
        )
        if damping_figure is not None:
            drawn("plot_tank_damping", damping, damping_figure, quiet=json)
        return drawn("plot_tank", found, path, quiet=json)
    rows = read_fill_table(history, read)
    course = slosh_masses_history(read, rows.fill, rows.acceleration, rows.time)
    if not any(course.rows):
        rule = f"has no row with slosh masses; row 1: {course.reason[0]}"
        raise refused("--history", history, rule, "mend the rows; 50 % of the volume is 50 under fill [%]")
    print(course.to_json() if json else course)
    if table is not None:
        write_fill_history(course, table)
        if not json:
            print(f"table: {table}")
    return drawn("plot_fill_history", course, path, quiet=json)


@app.command
def validate(case: CaseFile) -> int:
    """Check a case file and say what was read."""
    read = read_case(case)
    tanks = ", ".join(tank.name for tank in read.vehicle.tanks)
    print(f"{case}: valid. {read.name}; tanks: {tanks}")
    for note in read.source.notes if read.source is not None else ():
        print(f"  - {note}")
    return 0


@app.command
def schema(of: Annotated[Literal["case", "tank"], Parameter(help="which file")] = "case") -> int:
    """Print the JSON schema of the case file or the tank file, for completion in an editor."""
    print(json.dumps({"case": case_schema, "tank": tank_schema}[of](), indent=1))
    return 0


@app.command
def example(name: Annotated[str, Parameter(help="name of a shipped example")] = "") -> int:
    """Write a shipped example case, tank, record, flight or dispersion to the current folder; else list them."""
    listed = [*example_names(), *example_tank_names(), *example_record_names(), *example_flight_names()]
    listed += example_dispersion_names()
    print(f"wrote {write_example(name, Path.cwd())}" if name else "\n".join(listed))
    return 0
