"""The command line: one subcommand per verb; it parses, calls and prints."""

import json
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from json import dumps
from pathlib import Path
from typing import Annotated, Any

import cyclopts
import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.text import Text

from sloshpy.assess import Assessment, assess
from sloshpy.case import Case
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.errors import InputError, OutsideValidity, Problem
from sloshpy.files import (
    case_schema,
    example_names,
    example_tank_names,
    read_case,
    read_fill_table,
    read_tank,
    write_example,
    write_fill_history,
)
from sloshpy.limit_cycle import (
    LimitCycle,
    degradation_map,
    growth_curve,
    limit_cycles,
    periodic_orbit,
    predict_limit_cycle,
    two_axis_cycles,
)
from sloshpy.simulation import Noise, OneMinusCosine, forced_response, simulate, verify
from sloshpy.stability import (
    damping_sensitivity,
    damping_sweep,
    disc_margin_curve,
    margin_table,
    margins,
    required_damping_map,
    root_locus,
)
from sloshpy.tank import slosh_masses, slosh_masses_history, tank_damping
from sloshpy.units import Array, UnitError, parse

app = cyclopts.App(
    name="sloshpy",
    version=version("sloshpy"),
    help="Decide whether propellant slosh and a rocket's autopilot get along.",
    help_format="plaintext",
)

CaseFile = Annotated[Path, Parameter(help="case file (TOML)")]
Output = Annotated[
    Path | None,
    Parameter(name=["-o", "--output"], help="figure file, format by suffix; default: a PNG beside the case"),
]
Damping = Annotated[
    str | None, Parameter(help="slosh damping: 4.8% for every tank, or LOX=4.8%,LH2=1%; default: by each tank's law")
]
Dampings = Annotated[str | None, Parameter(help="dampings to show, as in 1%,3%,4.8%; default: four telling ones")]
Amplitude = Annotated[
    str | None, Parameter(help="slosh amplitude at which each law is read: 0.2m, or LOX=0.2m,LH2=0.1m")
]
Tank = Annotated[str | None, Parameter(help="name of the tank; default: the first")]


@app.command(name="assess")
def assess_command(
    case: CaseFile,
    *,
    json: Annotated[bool, Parameter(negative="", help="print one JSON object in SI units")] = False,
    report: Annotated[Path | None, Parameter(help="write a self-contained HTML report")] = None,
    figures: Annotated[Path | None, Parameter(help="write every figure into this folder")] = None,
    damping: Damping = None,
    amplitude: Amplitude = None,
) -> int:
    """Review a case: verdict with reasons, margins, danger zone, required damping, limit cycles.

    Exit status: 0 the criteria are met, 1 one is not (or no verdict is supported), 2 the input was refused.
    """
    read = read_case(case)
    if report is not None:
        _writable(case, report, {".html", ".htm"})
    if figures is not None and figures.exists() and not figures.is_dir():
        raise _refused("--figures", figures, "is a file", "name a folder")
    review = assess(read, **_read_at(read, damping, amplitude))
    if report is not None or figures is not None:
        from sloshpy.report import write_figures, write_report  # matplotlib: only when something is drawn

        if figures is not None:
            write_figures(review, figures)
        if report is not None:
            write_report(review, report)
    if json:
        print(review.to_json())
    else:
        _print_review(review)
    return 0 if review.verdict == "pass" else 1


@app.command(name="margins")
def margins_command(case: CaseFile, *, damping: Damping = None, amplitude: Amplitude = None) -> int:
    """Print the margins of every mode, the closed-loop poles, and what each tank's damping does to them."""
    read = read_case(case)
    at = _read_at(read, damping, amplitude)
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

    read, path = read_case(case), _figure(case, output, "sweep")
    print(damping_sweep(read, _dampings(damping), _tank(read, tank)))
    curve = disc_margin_curve(read, None, _tank(read, tank))
    return _save(plots.plot_damping_sweep(curve), path)


@app.command
def locus(case: CaseFile, *, damping: Damping = None, output: Output = None) -> int:
    """Draw the root locus over the loop gain (fig 4), by default without slosh damping."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), _figure(case, output, "locus")
    result = root_locus(read, None if damping is None else _damping(read, damping))
    print(result)
    return _save(plots.plot_root_locus(result), path)


@app.command
def danger_zone(
    case: CaseFile,
    *,
    tank: Tank = None,
    every: Annotated[bool, Parameter(name="--all", negative="", help="every tank in one figure")] = False,
    output: Output = None,
) -> int:
    """Print the danger zone and draw the damping needed along the vehicle."""
    from sloshpy import plots  # as above

    read, path = read_case(case), _figure(case, output, "danger-zone")
    if every:
        maps = [required_damping_map(read, j) for j in range(len(read.vehicle.tanks))]
        print("\n".join(str(one) for one in maps))
        return _save(plots.plot_danger_zones(maps), path)
    result = required_damping_map(read, _tank(read, tank))
    print(result)
    return _save(plots.plot_danger_zone(result), path)


@app.command
def growth(case: CaseFile, *, tank: Tank = None, output: Output = None) -> int:
    """Print and draw how a tank's slosh mode grows over its amplitude, and every limit cycle of the loop as given."""
    from sloshpy import plots  # as above

    read, path = read_case(case), _figure(case, output, "growth")
    curve = growth_curve(read, _tank(read, tank))
    print(curve)
    cycles = limit_cycles(read)
    print("\n".join(f"  {cycle}" for cycle in cycles) or "  no limit cycle of the loop as given")
    return _save(plots.plot_growth(curve, cycles), path)


@app.command(name="map")
def map_command(case: CaseFile, *, tank: Tank = None, output: Output = None) -> int:
    """Print and draw the limit cycle over extra gain and delay, with the disc margin and the engine's limit on it."""
    from sloshpy import plots  # as above

    read, path = read_case(case), _figure(case, output, "map")
    result = degradation_map(read, _tank(read, tank))
    print(result)
    return _save(plots.plot_degradation_map(result), path)


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


@app.command
def noise(
    case: CaseFile,
    *,
    engine: Annotated[str | None, Parameter(help="rms of noise on the engine command, as in 0.1 deg")] = None,
    wind: Annotated[str | None, Parameter(help="rms of the lateral wind, as in 3 m/s")] = None,
    low: Annotated[str, Parameter(help="lowest frequency of the noise")] = "0.05 Hz",
    high: Annotated[str, Parameter(help="highest frequency of the noise")] = "5 Hz",
) -> int:
    """Print the stationary rms of slosh and engine under noise of even power between two frequencies."""
    read = read_case(case)
    if engine is None and wind is None:
        raise _refused("--engine", "", "or --wind is needed", 'write --engine "0.1 deg"')
    ends = [_quantity(f"--{name}", text, "rad/s") for name, text in (("low", low), ("high", high))]
    parts = [
        None if text is None else Noise(rms=_quantity(option, text, unit), low=ends[0], high=ends[1])
        for option, text, unit in (("--engine", engine, "rad"), ("--wind", wind, "m/s"))
    ]
    print(forced_response(read, *parts))
    return 0


@app.command
def limit_cycle(case: CaseFile, *, tank: Tank = None, output: Output = None) -> int:
    """Predict the limit cycle under degraded margins by the paper's five steps and draw it (fig 8)."""
    from sloshpy import plots  # as above

    read, path = read_case(case), _figure(case, output, "limit-cycle")
    result = predict_limit_cycle(read, _tank(read, tank))
    print(result)
    if not result.band.size:
        print("no figure: there is no limit cycle to draw")
        return _accepted(result)
    _save(plots.plot_limit_cycle(result), path)
    return _accepted(result)


@app.command(name="simulate")
def simulate_command(
    case: CaseFile,
    *,
    duration: Annotated[str, Parameter(help="length of the run")] = "300 s",
    initial_slosh: Annotated[str, Parameter(help="displacement of every slosh mass at the start")] = "0.01 m",
    gain: Annotated[str, Parameter(help="extra loop gain")] = "0 dB",
    delay: Annotated[str, Parameter(help="extra delay")] = "0 s",
    degraded: Annotated[
        bool, Parameter(negative="", help="add the gain and delay that the five steps predict to be neutral")
    ] = False,
    gust: Annotated[str | None, Parameter(help="peak of a 1-cosine gust at 10 s, as in 9 m/s")] = None,
    gust_duration: Annotated[str, Parameter(help="length of the gust")] = "2 s",
    damping: Damping = None,
    tank: Tank = None,
    output: Output = None,
) -> int:
    """Simulate the loop with nonlinear damping and draw slosh and engine angle over time (fig 9)."""
    from sloshpy import plots  # as above

    read, path = read_case(case), _figure(case, output, "simulate")
    extra = _quantity("--gain", gain, "dB"), _quantity("--delay", delay, "s")
    start = _quantity("--initial-slosh", initial_slosh, "m")
    if not 0.0 < start <= 100.0:
        raise _refused("--initial-slosh", initial_slosh, "must be > 0 m and <= 100 m", "from rest nothing starts")
    if degraded:
        predicted = predict_limit_cycle(read, _tank(read, tank))
        if not predicted.band.size or predicted.delay < 0.0:
            why = "; ".join(predicted.reasons) or "it is a phase advance, which no delay makes"
            raise OutsideValidity(f"no degradation to simulate: {why}")
        extra = extra[0] * predicted.gain, extra[1] + predicted.delay
    changed = read.model_copy(update={"autopilot": read.autopilot.degraded(*extra)})
    result = simulate(
        changed,
        _quantity("--duration", duration, "s"),
        start,
        None if damping is None else _damping(read, damping),
        wind=None if gust is None else _gust(gust, gust_duration),
    )
    print(result)
    return _save(plots.plot_time_history(result), path)


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
    output: Output = None,
) -> int:
    """Print the slosh masses of a tank from its shape and fill, and draw its section (fig 1)."""
    read = read_tank(file)
    path = None if json and output is None else _figure(file, output, "tank" if history is None else "history")
    if table is not None:
        if history is None:
            raise _refused("--table", table, "needs --history", "name the CSV of the fills")
        _writable(file, table, {".csv", ".xlsx", ".nc"})
    if history is None:
        found = slosh_masses(read)
        damping = tank_damping(found)
        print(
            dumps(found.to_dict() | damping.to_dict(), indent=1)
            if json
            else "\n".join(filter(None, map(str, (found, damping))))
        )
        return _drawn("plot_tank", found, path, quiet=json)
    rows = read_fill_table(history)
    course = slosh_masses_history(read, rows.fill, rows.acceleration, rows.time)
    print(course.to_json() if json else course)
    if table is not None:
        write_fill_history(course, table)
        if not json:
            print(f"table: {table}")
    return _drawn("plot_fill_history", course, path, quiet=json)


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
def schema() -> int:
    """Print the JSON schema of the case file, for completion in an editor."""
    print(json.dumps(case_schema(), indent=1))
    return 0


@app.command
def example(name: Annotated[str, Parameter(help="name of a shipped example")] = "") -> int:
    """Write a shipped example case or tank to the current folder; without a name, list them."""
    listed = [*example_names(), *example_tank_names()]
    print(f"wrote {write_example(name, Path.cwd())}" if name else "\n".join(listed))
    return 0


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line, by default on the words it was called with.

    Faults of the input go to standard error, with exit status 2.
    """
    try:
        status = app(sys.argv[1:] if words is None else list(words), exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        command = " ".join(error.command_chain) if error.command_chain else ""
        print(f"error: {str(error).rstrip('.')}; see sloshpy {command} --help".replace("  ", " "), file=sys.stderr)
        status = 2
    except InputError as error:
        for problem in error.problems:
            print(f"error: {problem}", file=sys.stderr)
        status = 2
    except BrokenPipeError:  # the reader, `head` say, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    except (OutsideValidity, ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        status = 2
    sys.exit(status)


def _sweep(case: Path, damping: str | None, tank: str | None, output: Path | None, figure: str) -> int:
    from sloshpy import plots  # as above

    read, path = read_case(case), _figure(case, output, figure.replace("_", "-"))
    result = damping_sweep(read, _dampings(damping), _tank(read, tank))
    print(result)
    draw: dict[str, Any] = {"bode": plots.plot_bode, "nichols": plots.plot_nichols, "tvc_gain": plots.plot_tvc_gain}
    return _save(draw[figure](result), path)


def _figure(case: Path, output: Path | None, name: str) -> Path:
    """Return where a figure goes, settled before any work: beside the case as a PNG, or as asked."""
    path = case.with_name(f"{case.stem}-{name}.png") if output is None else output
    _writable(case, path, {".png", ".svg", ".pdf"})
    return path


def _writable(case: Path, path: Path, suffixes: set[str]) -> None:
    """Refuse a file that cannot be written, or must not be: of another format, in no folder, the case itself."""
    if path.is_dir():
        raise _refused("output", path, "is a folder", "name a file in it")
    if path.suffix.lower() not in suffixes:
        raise _refused("output", path, f"must end in {', '.join(sorted(suffixes))}", "name a file of that format")
    if not path.parent.is_dir():
        raise _refused("output", path, "has no folder to stand in", "make the folder first")
    if path.exists() and path.samefile(case):
        raise _refused("output", path, "is the case file itself", "name another file")


def _refused(key: str, value: object, rule: str, cure: str) -> InputError:
    return InputError(Problem(key=key, value=str(value), rule=rule, cure=cure))


def _save(axes: Any, path: Path) -> int:
    from sloshpy import plots  # as above

    plots.save_figure(axes, path)
    print(f"figure: {path}")
    return 0


def _drawn(plot: str, result: Any, path: Path | None, quiet: bool) -> int:
    if path is None:
        return 0
    from sloshpy import plots  # as above

    plots.save_figure(getattr(plots, plot)(result), path)
    if not quiet:
        print(f"figure: {path}")
    return 0


def _print_review(review: Assessment) -> None:
    first, _, rest = str(review).partition("\n")
    style = {"pass": "bold green", "fail": "bold red"}.get(review.verdict, "bold yellow")
    Console(soft_wrap=True, highlight=False).print(Text(first, style=style))
    print(rest)


def _accepted(result: LimitCycle) -> int:
    return 0 if result.acceptable else 1


def _gust(peak: str, duration: str) -> OneMinusCosine:
    length = _quantity("--gust-duration", duration, "s")
    if not length > 0.0:
        raise _refused("--gust-duration", duration, "must be > 0 s", 'write "2 s"')
    return OneMinusCosine(size=_quantity("--gust", peak, "m/s"), duration=length, start=10.0)


def _read_at(case: Case, damping: str | None, amplitude: str | None) -> dict[str, Array]:
    """Return what the loop is read at, from the options."""
    if damping is not None and amplitude is not None:
        raise _refused("--damping and --amplitude", "", "exclude each other", "give one of them")
    if damping is not None:
        return {"damping": _damping(case, damping)}
    if amplitude is not None:
        named = _named(case, "--amplitude", amplitude)
        least = [tank.damping.smallest_amplitude for tank in case.vehicle.tanks]
        return {
            "amplitude": np.array(
                [_quantity("--amplitude", t, "m") if t else a for t, a in zip(named, least, strict=True)]
            )
        }
    return {}


def _damping(case: Case, text: str) -> Array:
    from sloshpy.dynamics import open_loop

    given = _named(case, "--damping", text)
    return np.array([_ratio("--damping", t) if t else xi for t, xi in zip(given, open_loop(case).damping, strict=True)])


def _dampings(text: str | None) -> Array | None:
    """Return the dampings of a sweep, None for the default ones."""
    return None if text is None else np.array([_ratio("--damping", part) for part in text.split(",")])


def _named(case: Case, option: str, text: str) -> list[str]:
    """Return the text meant for each tank: one for all, or NAME=text,NAME=text; "" where a tank is not named."""
    names = [tank.name for tank in case.vehicle.tanks]
    if not text.strip():
        raise _refused(option, text, "is empty", "leave the option out, or give it a value")
    if "=" not in text:
        return [text] * len(names)
    given: dict[str, str] = {}
    for part in text.split(","):
        name, _, value = (x.strip() for x in part.partition("="))
        if name not in names or not value or name in given:
            rule = "names no tank" if name not in names else "has no value" if not value else "names a tank twice"
            raise _refused(option, part, rule, f"write {names[0]}=VALUE; tanks: {', '.join(names)}")
        given[name] = value
    return [given.get(name, "") for name in names]


def _tank(case: Case, name: str | None) -> int:
    names = [tank.name for tank in case.vehicle.tanks]
    if name is not None and name not in names:
        raise _refused("--tank", name, "is no tank of the case", f"one of {', '.join(names)}")
    return 0 if name is None else names.index(name)


def _ratio(option: str, text: str) -> float:
    value = _quantity(option, text, "1")
    if not 0.0 <= value <= 1.0:
        raise _refused(option, text, "must be between 0 and 1", 'a percentage is "4.8%"')
    return value


def _quantity(option: str, text: str, unit: str) -> float:
    """Return an option's quantity in SI; none of them may be negative (a gain in dB is a ratio here)."""
    try:
        value = parse(text, unit)
    except UnitError as error:
        raise _refused(option, text, error.rule, error.cure) from None
    if value < 0.0:
        raise _refused(option, text, "must be >= 0", "drop the sign")
    return value
