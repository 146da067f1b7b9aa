"""Every shipped example reads, says where its numbers come from, and shows what it is there to show."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

import oracle_flexible
from sloshpy.assess import assess
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.files import example_names, read_case, write_example
from sloshpy.simulation import verify

EXAMPLES = ["flexible_launcher", "light_upper_stage", "two_tanks", "upper_stage", "upper_stage_printed_alpha"]


def example(name: str, folder: Path):
    return read_case(write_example(name, folder))


def test_the_shipped_examples_are_these():
    assert sorted(example_names()) == EXAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_says_what_is_published_and_what_is_reconstructed(name):
    text = (files("sloshpy") / "data" / f"{name}.toml").read_text(encoding="utf-8")
    head = text[: text.index("[vehicle]")].lower()
    assert "table 1" in head or "reconstructed" in head


def test_two_tanks_lock_into_one_cycle_that_the_simulation_confirms(tmp_path):
    as_given = verify(example("two_tanks", tmp_path))[0]
    assert as_given.predicted.slosh_amplitude["LH2"] > as_given.predicted.slosh_amplitude["LOX"]
    assert as_given.difference < 2e-3
    assert as_given.omega == pytest.approx(as_given.predicted.omega, rel=1e-3)


def test_the_light_upper_stage_is_refused_for_its_engine_motion(tmp_path):
    review = assess(example("light_upper_stage", tmp_path))
    assert review.verdict == "fail"
    assert "LOX" in review.reasons[0]
    assert "of engine, >" in review.reasons[0]
    assert review.tanks[0].zone.inside
    # twice in a burn of minutes is nothing: the small-amplitude growth doubles in seconds
    assert float(np.min(review.poles.time_to_double)) < 20.0


def test_the_flexible_launcher_is_stable_by_the_oracles_poles_and_needs_damping_in_core_lox_alone(tmp_path):
    case = example("flexible_launcher", tmp_path)
    loop = open_loop(case)
    poles = closed_loop_poles(loop)
    assert poles.stable
    assert {"core LOX slosh", "first bending", "third bending", "actuator", "rigid body"} <= set(poles.name)
    assert oracle_flexible.stable(oracle_flexible.second_order(case.vehicle, loop.damping), case.autopilot)
    review = assess(case)
    assert review.verdict == "pass"
    limited = [tank.name for tank in review.tanks if tank.limit_cycle.band.size]
    assert limited == ["core LOX"]
