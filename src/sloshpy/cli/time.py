"""Commands about motion in time: simulation and noise."""

from typing import Annotated

from cyclopts import Parameter

from sloshpy.cli.app import app
from sloshpy.cli.options import (
    CaseFile,
    Damping,
    Output,
    Tank,
    damping_of,
    figure_path,
    quantity,
    refused,
    save,
    tank_of,
)
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_case
from sloshpy.limit_cycle import (
    predict_limit_cycle,
)
from sloshpy.simulation import Noise, OneMinusCosine, forced_response, simulate


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
    from sloshpy import plots  # matplotlib: only when something is drawn

    read, path = read_case(case), figure_path(case, output, "simulate")
    extra = quantity("--gain", gain, "dB"), quantity("--delay", delay, "s")
    start = quantity("--initial-slosh", initial_slosh, "m")
    if not 0.0 < start <= 100.0:
        raise refused("--initial-slosh", initial_slosh, "must be > 0 m and <= 100 m", "from rest nothing starts")
    if tank is not None and not degraded:
        raise refused("--tank", tank, "is for --degraded: every tank is simulated", "drop it, or add --degraded")
    if degraded:
        predicted = predict_limit_cycle(read, tank_of(read, tank))
        if not predicted.band.size or predicted.delay < 0.0:
            why = "; ".join(predicted.reasons) or "it is a phase advance, which no delay makes"
            rest = [t.name for t in read.vehicle.tanks if t.name != predicted.tank]
            cure = f"; choose another tank with --tank: {', '.join(rest)}" if rest else ""
            raise OutsideValidity(f"no degradation of {predicted.tank} to simulate: {why}{cure}")
        extra = extra[0] * predicted.gain, extra[1] + predicted.delay
    changed = read.model_copy(update={"autopilot": read.autopilot.degraded(*extra)})
    result = simulate(
        changed,
        quantity("--duration", duration, "s"),
        start,
        None if damping is None else damping_of(read, damping),
        wind=None if gust is None else _gust(gust, gust_duration),
    )
    print(result)
    save(plots.plot_time_history(result), path)
    return 1 if result.stopped else 0


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
        raise refused("--engine", "", "or --wind is needed", 'write --engine "0.1 deg"')
    ends = [quantity(f"--{name}", text, "rad/s") for name, text in (("low", low), ("high", high))]
    parts = [
        None if text is None else Noise(rms=quantity(option, text, unit), low=ends[0], high=ends[1])
        for option, text, unit in (("--engine", engine, "rad"), ("--wind", wind, "m/s"))
    ]
    print(forced_response(read, *parts))
    return 0


def _gust(peak: str, duration: str) -> OneMinusCosine:
    length = quantity("--gust-duration", duration, "s")
    if not length > 0.0:
        raise refused("--gust-duration", duration, "must be > 0 s", 'write "2 s"')
    return OneMinusCosine(size=quantity("--gust", peak, "m/s"), duration=length, start=10.0)
