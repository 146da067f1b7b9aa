"""Runs in gusts: peak, start, duration and slosh at the start of each draw, against another integrator."""

import numpy as np
import pytest
from uncertain import factor, stage

from cases import paper_case
from sloshpy.dispersion import Linear, Nonlinear, Parameter, Uniform, drawn, run_campaign
from sloshpy.dispersion.answers import answered, step_of
from sloshpy.errors import InputError
from sloshpy.files import read_dispersion, write_example
from sloshpy.simulation import OneMinusCosine, simulate
from sloshpy.vehicle import Aerodynamics

AIR = Aerodynamics(normal_force_slope=2e5, center_of_pressure=9.0, speed=400.0)
BLOWN = Nonlinear(duration=60.0, initial_slosh=0.05, gust_speed=30.0, gust_start=5.0, gust_duration=4.0)


def blown(analysis=BLOWN):
    start = Parameter(input="run.gust_start", distribution=Uniform(low=1.0, high=20.0), factor=False)
    more = (factor("run.gust_speed", 0.3), start, factor("run.gust_duration", 0.5), factor("run.initial_slosh", 0.2))
    return stage(
        analysis, case=paper_case(vehicle={"aerodynamics": AIR}), parameters=(*more, factor("vehicle.mass", 0.02))
    )


def test_a_run_in_a_gust_is_that_of_the_single_simulation():
    d = blown()
    campaign, draws = run_campaign(d, 4, 3), drawn(d, 3, 0, 4)
    assert step_of(d) == pytest.approx(2.0 / 100.0)
    for k, (speed, start, duration, slosh, mass) in enumerate(draws):
        gust = OneMinusCosine(size=30.0 * speed, start=start, duration=4.0 * duration)
        case = paper_case(vehicle={"aerodynamics": AIR, "mass": 1.6e4 * mass})
        run = simulate(case, 60.0, 0.05 * slosh, step=0.01, wind=gust)
        assert campaign.column("slosh_peak.LOX")[k] == pytest.approx(np.max(np.abs(run.slosh)), rel=1e-4)
        assert campaign.column("engine_peak")[k] == pytest.approx(np.max(np.abs(run.tvc)), rel=1e-3)
    assert len(set(campaign.column("slosh_peak.LOX").tolist())) == 4


def test_runs_in_gusts_have_the_same_bits_alone():
    d = blown()
    rows = answered(d, 3, 0, 70)
    for k in (0, 33, 69):
        assert np.array_equal(answered(d, 3, k, 1).values[0], rows.values[k], equal_nan=True)


def test_what_varies_of_a_run_is_asked_of_a_simulation():
    with pytest.raises(InputError, match="is asked of a simulation"):
        run_campaign(blown(Linear()), 5, 1)


FILE = """case = "upper_stage.toml"
[nonlinear]
duration = "100 s"
gust_speed = "20 m/s"
gust_start = "5 s"
[[vary]]
input = "run.gust_duration"
distribution = "uniform"
as = "absolute"
low = "2 s"
high = "8 s"
"""


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("", "", ""),
        ('gust_speed = "20 m/s"', "", "there is no gust that could vary"),
        ("run.gust_duration", "run.gust", "a run has no input gust"),
        ("[nonlinear]", "[linear]", "is asked of a simulation"),
        ('low = "2 s"', 'low = "0 s"', "makes the input 0"),
        ('"5 s"', '"-5 s"', "gust_start"),
        ("AIR", "", "the case has none"),
    ],
)
def test_gusts_in_a_file(tmp_path, old, new, told):
    case = write_example("upper_stage", tmp_path)
    if old != "AIR":
        air = '[aerodynamics]\nnormal_force_slope = "2e5 N"\ncenter_of_pressure = "9 m"\nspeed = "400 m/s"\n'
        case.write_text(case.read_text().replace("[autopilot]", f"{air}\n[autopilot]"))
    file = tmp_path / "d.toml"
    file.write_text(FILE.replace(old, new) if old else FILE)
    if told:
        with pytest.raises(InputError, match=told):
            read_dispersion(file)
        return
    d = read_dispersion(file)
    assert d.analysis == Nonlinear(duration=100.0, gust_speed=20.0, gust_start=5.0)
    assert d.inputs == ("run.gust_duration",)
    assert np.all(run_campaign(d, 3, 1).column("slosh_peak.LOX") > 0.0)
