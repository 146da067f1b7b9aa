"""Dispersions of the paper's stage for the tests, and answers that go wrong on purpose; workers import this file."""

import os
import signal
import time

import numpy as np

from cases import paper_case
from sloshpy.dispersion import Dispersion, Linear, Nonlinear, Parameter, TruncatedNormal, Uniform
from sloshpy.dispersion.rows import Rows
from sloshpy.files import write_example


def factor(name, spread, **more):
    return Parameter(input=name, distribution=Uniform(low=1.0 - spread, high=1.0 + spread), **more)


def stage(analysis=None, *, case=None, parameters=None, **more):
    """The paper's stage with five uncertain inputs."""
    damping = TruncatedNormal(mean=1.0, sigma=0.1, low=0.6, high=1.4)
    usual = (
        factor("vehicle.mass", 0.03),
        factor("vehicle.inertia", 0.05),
        factor("tank.LOX.frequency", 0.05),
        Parameter(input="tank.*.damping", distribution=damping),
        factor("autopilot.rate_gain", 0.05),
    )
    return Dispersion(
        name="stage",
        case=case or paper_case(),
        parameters=usual if parameters is None else parameters,
        analysis=analysis or Linear(amplitude=0.5),
        **more,
    )


RUN = Nonlinear(duration=100.0, initial_slosh=0.2, gain=10.0 ** (4.4 / 20.0), delay=0.17)


def toy(first, count):
    """A cheap answer: a hash of the case number."""
    k = np.arange(first, first + count, dtype=float)
    values = np.stack([np.sin(k * 12.9898) * 43758.5453 % 1.0, k], axis=-1)
    return Rows(first=first, values=values, status=np.zeros(count), reasons=("",) * count)


def slow(first, count):
    time.sleep(0.02 * count)
    return toy(first, count)


def crashing(first, count):
    """Case 7 kills its process."""
    if first <= 7 < first + count:
        os.kill(os.getpid(), signal.SIGKILL)
    return toy(first, count)


def hanging(first, count):
    """Case 7 never ends."""
    if first <= 7 < first + count:
        time.sleep(3600.0)
    return toy(first, count)


def raising(first, count):
    """Case 7 meets a fault of ours."""
    if first <= 7 < first + count:
        raise KeyError("a fault")
    return toy(first, count)


def lying(first, count):
    """Case 7 comes back without its number."""
    rows = toy(first, count)
    if first <= 7 < first + count:
        rows.values[7 - first, 0] = np.nan
    return rows


FLIGHT = """name = "short"
[[table]]
name = "all"
file = "all.csv"
interpolation = "linear"
time = "t"
[table.columns]
"vehicle.mass" = "m"
[[phase]]
name = "coast"
case = "stage.toml"
start = "0 s"
end = "20 s"
step = "10 s"
tables = ["all"]
"""
DISPERSED = """name = "short flight"
flight = "short.toml"
{analysis}[[vary]]
input = "vehicle.mass"
distribution = "uniform"
low = 0.98
high = 1.02
"""


def short_flight(folder, analysis):
    """Write a flight of 20 s and its dispersion by an analysis, a table in the file's own words; return its file."""
    write_example("upper_stage", folder).rename(folder / "stage.toml")
    (folder / "short.toml").write_text(FLIGHT)
    (folder / "all.csv").write_text("t [s],m [kg]\n0,16000\n20,15200\n")
    file = folder / "dispersed.toml"
    file.write_text(DISPERSED.format(analysis=analysis))
    return file
