"""Commands about the loop: margins, responses, root locus, danger zone."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import (
    Amplitude,
    CaseFile,
    Damping,
    Dampings,
    Output,
    Tank,
    damping_of,
    dampings_of,
    figure_path,
    read_at,
    refused,
    save,
    tank_of,
)
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.files import read_case
from sloshpy.stability import (
    damping_sensitivity,
    damping_sweep,
    disc_margin_curve,
    margin_table,
    required_damping_map,
    root_locus,
)


@app.command(name="margins")
def margins_command(case: CaseFile, *, damping: Damping = None, amplitude: Amplitude = None) -> int:
    """Print the margins of every mode, the closed-loop poles, and what each tank's damping does to them."""
    read = read_case(case)
    at = read_at(read, damping, amplitude)
    table = margin_table(read, **at)
    print(table)
    print("closed-loop poles")
    print(closed_loop_poles(open_loop(read, **at)))
    print(damping_sensitivity(read, **at))
    return 0 if table.stable else 1


@app.command
def bode(case: CaseFile, *, damping: Dampings = None, tank: Tank = None, output: Output = None) -> int:
    """Draw the open-loop Bode diagram for a sweep of slosh damping (fig 5)."""
    return _sweep(case, damping, tank, output, "bode")


@app.command
def nichols(case: CaseFile, *, damping: Dampings = None, tank: Tank = None, output: Output = None) -> int:
    """Draw the Nichols chart with the disc-margin ellipse for a sweep of slosh damping (fig 6)."""
    return _sweep(case, damping, tank, output, "nichols")


@app.command
def gain(case: CaseFile, *, damping: Dampings = None, tank: Tank = None, output: Output = None) -> int:
    """Draw the gain from engine angle to slosh displacement for a sweep of slosh damping (fig 7)."""
    return _sweep(case, damping, tank, output, "tvc_gain")


@app.command
def sweep(case: CaseFile, *, damping: Dampings = None, tank: Tank = None, output: Output = None) -> int:
    """Print and draw the disc margin, signed by stability, against slosh damping."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, "sweep")
    print(damping_sweep(read, dampings_of(damping), tank_of(read, tank)))
    curve = disc_margin_curve(read, None, tank_of(read, tank))
    return save(plots.plot_damping_sweep(curve), path)


@app.command
def locus(case: CaseFile, *, damping: Damping = None, output: Output = None) -> int:
    """Draw the root locus over the loop gain (fig 4), by default without slosh damping."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, "locus")
    result = root_locus(read, None if damping is None else damping_of(read, damping))
    print(result)
    return save(plots.plot_root_locus(result), path)


@app.command
def danger_zone(
    case: CaseFile,
    *,
    tank: Tank = None,
    every: Annotated[bool, Parameter(name="--all", negative="", help="every tank in one figure")] = False,
    output: Output = None,
) -> int:
    """Print the danger zone and draw the damping needed along the vehicle."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, "danger-zone")
    if every and tank is not None:
        raise refused("--tank", tank, "and --all exclude each other", "give one of them")
    if every:
        maps = [required_damping_map(read, j) for j in range(len(read.vehicle.tanks))]
        print("\n".join(str(one) for one in maps))
        return save(plots.plot_danger_zones(maps), path)
    result = required_damping_map(read, tank_of(read, tank))
    print(result)
    return save(plots.plot_danger_zone(result), path)


def _sweep(case: Path, damping: str | None, tank: str | None, output: Path | None, figure: str) -> int:
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, figure.replace("_", "-"))
    result = damping_sweep(read, dampings_of(damping), tank_of(read, tank))
    print(result)
    draw: dict[str, Any] = {"bode": plots.plot_bode, "nichols": plots.plot_nichols, "tvc_gain": plots.plot_tvc_gain}
    return save(draw[figure](result), path)
