"""The command about free decays: a test's record to the damping line of a case file."""

from json import dumps
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import Output, drawn, figure_path, quantity, refused
from sloshpy.damping import FreeDecay, free_decay
from sloshpy.damping.decay_record import DecayRecord, Measured
from sloshpy.damping.validity import check_share_of_radius
from sloshpy.errors import OutsideValidity
from sloshpy.files import damping_line, read_tank, read_time_history
from sloshpy.tank import SloshModes, slosh_masses


@app.command(name="decay")
def decay_command(
    file: Annotated[Path, Parameter(help="record of one decay: .csv, .xlsx, .mat or .nc, with units")],
    *,
    column: Annotated[str, Parameter(help="the column to fit, a length or a force")],
    amplitude: Annotated[
        Literal["displacement", "wave", "force"] | None,
        Parameter(help="what a length is: slosh-mass displacement, or wave height at the wall; peak, not peak to peak"),
    ] = None,
    wave_per_displacement: Annotated[
        float | None, Parameter(help="wave height at the wall per slosh-mass displacement")
    ] = None,
    force_per_displacement: Annotated[
        str | None, Parameter(help='lateral force per slosh-mass displacement, m_s w^2, as in "4000 N/m"')
    ] = None,
    tank: Annotated[Path | None, Parameter(help="tank file of the tested tank: gives scale and frequency")] = None,
    frequency_hint: Annotated[str | None, Parameter(help="expected slosh frequency, as in 0.32Hz")] = None,
    time_column: Annotated[str, Parameter(help="the column of the time")] = "time",
    start: Annotated[str | None, Parameter(help="fit from this time on, as in 2s")] = None,
    end: Annotated[str | None, Parameter(help="fit up to this time")] = None,
    radius: Annotated[str | None, Parameter(help="radius of the tested tank: prints a power law over A/R")] = None,
    full_radius: Annotated[
        str | None, Parameter(help="radius of a geometrically similar tank that the damping line is for")
    ] = None,
    seed: Annotated[int, Parameter(help="of the bootstrap")] = 0,
    json: Annotated[
        bool, Parameter(negative="", help="print one JSON object in SI units; no figure unless named")
    ] = False,
    output: Output = None,
) -> int:
    """Identify frequency and damping over the amplitude from a free decay; print a damping line for a case file.

    Exit status: 0 a damping line was found, 1 the record gives none without a scale, 2 the input was refused.
    """
    path = None if json and output is None else figure_path(file, output, "decay")
    if full_radius is not None and radius is None:
        raise refused("--full-radius", full_radius, "needs --radius", "name the radius of the tested tank")
    if seed < 0:
        raise refused("--seed", seed, "must be >= 0", "drop the sign")
    record = read_time_history(file, column, time_column=time_column)
    measured = _measured(record, amplitude)
    modes = None if tank is None else slosh_masses(read_tank(tank))
    scale, hint = _scale_and_hint(measured, wave_per_displacement, force_per_displacement, modes, frequency_hint)
    found = free_decay(
        record,
        measured,
        per_displacement=scale,
        frequency_hint=hint,
        start=None if start is None else quantity("--start", start, "s"),
        end=None if end is None else quantity("--end", end, "s"),
        seed=seed,
    )
    radii = [
        None if text is None else _length(name, text)
        for name, text in (("--radius", radius), ("--full-radius", full_radius))
    ]
    cautions = _cautions(found, modes, radii[0])
    try:
        lines = _law_lines(found, *radii)
    except OutsideValidity as error:
        lines = {"damping": None, "reason": str(error)}
    if json:
        said = found.to_dict()
        print(dumps(said | {"notes": [*cautions, *said["notes"]]} | lines, indent=1))
    else:
        print("\n".join([*cautions, str(found)]))
        _print_law(found, lines)
    drawn("plot_free_decay", found, path, quiet=json)
    return 0 if lines["damping"] else 1


def _measured(record: DecayRecord, amplitude: Measured | None) -> Measured:
    """Return what the column is: a force by its unit, a length only by what the user says."""
    if amplitude is not None:
        return amplitude
    if record.unit == "N":
        return "force"
    raise refused("--amplitude", "", "is missing", f'say what "{record.column}" is: --amplitude wave or displacement')


def _scale_and_hint(
    measured: Measured, wave: float | None, force: str | None, modes: SloshModes | None, hint: str | None
) -> tuple[float | None, float | None]:
    """Return the record per slosh-mass displacement and the expected frequency, from options or the tested tank."""
    expected = None if hint is None else _positive("--frequency-hint", hint, "rad/s")
    given = {"--wave-per-displacement": (wave, "wave"), "--force-per-displacement": (force, "force")}
    for option, (value, of) in given.items():
        if value is not None and measured != of:
            raise refused(option, value, f"does not belong to a {measured}", "leave it out, or mend --amplitude")
        if value is not None and modes is not None:
            raise refused(option, value, "and --tank exclude each other", "give one of them")
    if modes is not None:
        w, mass = float(modes.frequency[0]), float(modes.slosh_mass[0])
        per = {"displacement": 1.0, "wave": float(modes.wave_per_displacement[0]), "force": mass * w**2}
        return per[measured], w if expected is None else expected
    if wave is not None and not 0.0 < wave < 1e3:
        raise refused("--wave-per-displacement", wave, "must be > 0 and < 1000", "1.54 is that of a deep cylinder")
    return (wave if force is None else _positive("--force-per-displacement", force, "N/m")), expected


def _cautions(found: FreeDecay, modes: SloshModes | None, radius: float | None) -> list[str]:
    """Return what to know of the amplitude against the tank file's surface and the radius given."""
    radii = [*([] if modes is None else [modes.section.radius]), *([] if radius is None else [radius])]
    said = [check_share_of_radius(found, R) for R in radii]
    return list(dict.fromkeys(one for one in said if one))


def _law_lines(found: FreeDecay, radius: float | None, full_radius: float | None) -> dict[str, Any]:
    """Return the damping line, the formula beyond the tested range, and the law over A/R where it was asked for."""
    lines: dict[str, Any] = {"damping": damping_line(found.law), "formula": damping_line(found.formula)}
    if radius is not None:
        lines["coefficient"] = found.coefficient(radius)
        lines["tested_over_radius"] = [A / radius for A in found.tested]
        if full_radius is not None:
            lines["damping"] = damping_line(found.similar(radius, full_radius))
            del lines["formula"]  # it is the tested tank's
    return lines


def _print_law(found: FreeDecay, lines: dict[str, Any]) -> None:
    if lines["damping"] is None:
        print(f"no damping line: {lines['reason']}")
        return
    if "coefficient" in lines:
        low, high = lines["tested_over_radius"]
        p = found.choice.best.values[0, 3]
        print(
            f"  geometrically similar tanks: xi = {lines['coefficient']:.4g} (A/R)^{p:.4g} for A/R from {low:.4g} to "
            f"{high:.4g}; holds for what a baffle damps, not for what a smooth wall damps"
        )
    print(lines["damping"])
    if "formula" in lines and lines["formula"] != lines["damping"]:
        print(f"the line covers the tested amplitudes only. As a formula, which extrapolates: {lines['formula']}")


def _length(option: str, text: str) -> float:
    return _positive(option, text, "m")


def _positive(option: str, text: str, unit: str) -> float:
    value = quantity(option, text, unit)
    if not value > 0.0:
        raise refused(option, text, f"must be > 0 {unit}", "give a positive value")
    return value
