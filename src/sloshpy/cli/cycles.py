"""Commands about limit cycles: five steps, growth, map, exact orbit, both axes, verification."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import CaseFile, LivelyTank, Output, Tank, figure_path, lively_tank_of, save, tank_of
from sloshpy.errors import NoAttractor, OutsideValidity
from sloshpy.files import read_case
from sloshpy.limit_cycle import (
    Cycle,
    LimitCycle,
    degradation_map,
    growth_curve,
    limit_cycles,
    periodic_orbit,
    predict_limit_cycle,
    two_axis_cycles,
)
from sloshpy.simulation import verify
from sloshpy.stability import (
    margins,
)


@app.command
def limit_cycle(case: CaseFile, *, tank: Tank = None, output: Output = None) -> int:
    """Predict the limit cycle under degraded margins by the paper's five steps and draw it (fig 8)."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, "limit-cycle")
    result = predict_limit_cycle(read, tank_of(read, tank))
    print(result)
    if not result.band.size:
        print("no figure: there is no limit cycle to draw")
        return _accepted(result)
    save(plots.plot_limit_cycle(result), path)
    return _accepted(result)


@app.command
def growth(case: CaseFile, *, tank: LivelyTank = None, output: Output = None) -> int:
    """Print and draw how a tank's slosh mode grows over its amplitude, and every limit cycle of the loop as given."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, "growth")
    curve = growth_curve(read, lively_tank_of(read, tank))
    print(curve)
    cycles: tuple[Cycle, ...] = ()
    try:
        cycles = limit_cycles(read)
        print("\n".join(f"  {cycle}" for cycle in cycles) or "  no limit cycle of the loop as given")
    except NoAttractor as error:  # the curve shows as much
        print(f"  {error}")
    return save(plots.plot_growth(curve, cycles), path)


@app.command(name="map")
def map_command(case: CaseFile, *, tank: LivelyTank = None, output: Output = None) -> int:
    """Print and draw the limit cycle over extra gain and delay, with the disc margin and the engine's limit on it."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, "map")
    result = degradation_map(read, lively_tank_of(read, tank))
    print(result)
    return save(plots.plot_degradation_map(result), path)


@app.command
def orbit(case: CaseFile) -> int:
    """Print the exact periodic orbit of the loop as given: its harmonics, and by Floquet multipliers if it attracts."""
    found = periodic_orbit(read_case(case))
    print(found)
    return 0 if found.stable else 1


@app.command
def axes(pitch: CaseFile, yaw: Annotated[Path | None, Parameter(help="case file of the yaw axis")] = None) -> int:
    """Print the limit cycles of pitch and yaw together, and which of them attracts; without YAW both axes are equal."""
    cycles = two_axis_cycles(read_case(pitch), None if yaw is None else read_case(yaw))
    print("\n".join(str(cycle) for cycle in cycles) or "no limit cycle")
    return 0


@app.command(name="verify")
def verify_command(case: CaseFile) -> int:
    """Simulate every predicted limit cycle and print predicted, simulated, difference and other harmonics."""
    read = read_case(case)
    try:
        found = verify(read)
    except OutsideValidity as error:
        print(f"nothing to verify: {error}")
        return 1
    if not found and margins(read).neutral:
        print("nothing to verify: the loop is neutral at small amplitude, it neither grows nor decays")
        return 1
    print("\n".join(str(one) for one in found) if found else "no limit cycle is predicted")
    return 0 if all(one.predicted is not None for one in found) else 1


def _accepted(result: LimitCycle) -> int:
    return 0 if result.acceptable else 1
