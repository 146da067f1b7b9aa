"""Dispersions of the paper's stage for the tests, and answers that go wrong on purpose; workers import this file."""

import os
import signal
import time

import numpy as np

from cases import paper_case
from sloshpy.dispersion import Dispersion, Linear, Nonlinear, Parameter, TruncatedNormal, Uniform
from sloshpy.dispersion.rows import Rows


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
