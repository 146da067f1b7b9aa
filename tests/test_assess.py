"""The review: verdicts, the JSON contract, and what happens where two witnesses disagree."""

import importlib
import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest

import oracle
from cases import PAPER_LAW, paper_case, xi
from sloshpy.assess import assess
from sloshpy.case import Criteria
from sloshpy.damping import PowerDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_case, write_example
from sloshpy.limit_cycle import limit_cycles
from sloshpy.vehicle import SloshMass

TOP = {"name", "verdict", "reasons", "stable", "modes", "disc_margin", "minima", "crossings", "tanks", "limit_cycles"}
MODE = {"name", "kind", "tank", "frequency_hz", "damping_ratio", "growth_rate", "time_to_double"}
TANK = {
    "name",
    "danger_zone",
    "damping_ratio",
    "disc_margin",
    "neutral_damping",
    "required_damping",
    "required_damping_together",
    "shared_with",
    "limit_cycle",
}
CYCLE = {
    "required_damping",
    "band_hz",
    "slosh_amplitude_m",
    "tvc_amplitude_rad",
    "paper",
    "gain_db",
    "delay_s",
    "frequency_hz",
    "tvc_limit_rad",
    "acceptable",
    "coupled",
}


def strict(text):
    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_json_of_the_example_has_the_keys_of_the_contract():
    found = strict(assess(paper_case()).to_json())
    assert set(found) == TOP
    assert set(found["modes"][0]) == MODE
    assert set(found["disc_margin"]) == {"value", "frequency_hz", "mode"}
    assert set(found["minima"][0]) == {"disc_margin", "frequency_hz", "mode"}
    assert set(found["crossings"][0]) == {"kind", "frequency_hz", "margin_db", "margin_deg", "mode"}
    tank = found["tanks"][0]
    assert set(tank) == TANK
    assert {"aft_m", "forward_m", "l_m", "inside"} <= set(tank["danger_zone"])
    assert set(tank["disc_margin"]) == {"value", "frequency_hz"}
    assert set(tank["limit_cycle"]) == CYCLE
    assert set(tank["limit_cycle"]["paper"]) == {"slosh_amplitude_m", "tvc_amplitude_rad"}
    assert set(found["limit_cycles"][0]) == {"frequency_hz", "slosh_amplitude_m", "tvc_amplitude_rad", "stable"}
    assert found["limit_cycles"][0]["slosh_amplitude_m"].keys() == {"LOX"}


def test_json_says_what_the_parts_say():
    found = strict(assess(paper_case(), damping=0.01).to_json())
    assert found["stable"] is False
    assert found["disc_margin"]["value"] == pytest.approx(-1.2892, abs=5e-5)
    mode = found["modes"][0]
    assert (mode["name"], mode["kind"], mode["tank"]) == ("LOX slosh", "slosh", "LOX")
    assert mode["time_to_double"] == pytest.approx(23.29, abs=5e-3)
    assert mode["frequency_hz"] == pytest.approx(2.13377 / (2 * math.pi), rel=1e-5)
    assert found["tanks"][0]["damping_ratio"] == 0.01
    assert found["tanks"][0]["danger_zone"]["inside"] is True
    kinds = {c["kind"] for c in found["crossings"]}
    assert kinds == {"gain", "phase"}
    for c in found["crossings"]:
        assert (c["margin_db"] is None) == (c["kind"] == "gain")
        assert (c["margin_deg"] is None) == (c["kind"] == "phase")


def test_the_example_passes_and_constant_one_percent_fails():
    assert assess(paper_case(PAPER_LAW)).verdict == "pass"
    failed = assess(paper_case(xi(0.01)))
    assert failed.verdict == "fail"
    assert strict(failed.to_json())["stable"] is False
    assert any("LOX" in r for r in failed.reasons)
    assert assess(paper_case(xi(0.06))).verdict == "pass"


def test_a_tighter_engine_limit_fails_the_example():
    from sloshpy.case import Criteria

    found = assess(paper_case(criteria=Criteria(tvc_amplitude=math.radians(0.25))))
    assert found.verdict == "fail"


def test_damping_data_that_end_too_early_are_invalid():
    """T28: no extrapolation, no number, no pass."""
    short = TableDamping(amplitude=[0.0, 0.05, 0.15], ratio=[0.0, 0.005, 0.015])
    found = assess(paper_case(short))
    assert found.verdict == "invalid"
    cycle = strict(found.to_json())["tanks"][0]["limit_cycle"]
    assert cycle["slosh_amplitude_m"] is None
    assert cycle["tvc_amplitude_rad"] is None
    assert cycle["acceptable"] is None


def test_disagreement_of_the_witness_gives_no_answer(monkeypatch):
    """T04: reason WITNESS, and nothing about the loop is reported."""
    # the module, not the function of the same name in its package
    monkeypatch.setattr(importlib.import_module("sloshpy.stability.margins"), "unstable_count", lambda loop: 2)
    found = assess(paper_case(), damping=0.048)
    assert found.verdict == "invalid"
    assert any("WITNESS" in r for r in found.reasons)
    data = strict(found.to_json())
    for key in ("stable", "modes", "disc_margin", "minima", "crossings"):
        assert data[key] is None
    assert data["tanks"][0]["disc_margin"] == {"value": None, "frequency_hz": None}


def test_engine_limits_below_the_prediction_are_invalid_not_passed():
    """T31."""
    from sloshpy.autopilot import Actuator

    held = Actuator(frequency=100.0, damping=0.7, deflection_limit=2e-3)
    assert assess(paper_case(actuator=held)).verdict == "invalid"


def test_an_amplitude_beyond_the_data_is_refused_with_the_tanks_name():
    short = TableDamping(amplitude=[0.0, 0.05, 0.15], ratio=[0.0, 0.005, 0.015])
    with pytest.raises(OutsideValidity, match="LOX"):
        assess(paper_case(short), amplitude=0.2)


def test_no_tank_is_nothing_to_assess():
    case = paper_case()
    with pytest.raises(ValueError, match="no tank"):
        assess(case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": ()})}))


def test_json_of_many_random_cases_is_strict():
    from cases import random_case

    rng = np.random.default_rng(70)
    for _ in range(12):
        case, damping = random_case(rng, tanks=int(rng.integers(1, 3)))
        data = strict(assess(case, damping=damping).to_json())
        assert set(data) == TOP
        assert data["verdict"] in ("pass", "fail", "invalid")


def test_two_tanks_are_reviewed_each():
    more = (SloshMass(name="RP-1", slosh_mass=300.0, station=3.0, frequency=2.8, damping=PAPER_LAW),)
    found = strict(assess(paper_case(more=more)).to_json())
    assert [t["name"] for t in found["tanks"]] == ["LOX", "RP-1"]


def test_importing_the_package_does_not_import_the_heavy_libraries():
    code = (
        "import sys, sloshpy, sloshpy.assess;"
        "print([m for m in ('scipy.signal', 'matplotlib.pyplot', 'control', 'pandas', 'xarray') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"


def test_a_degraded_loop_with_several_growing_modes_gets_no_verdict_from_one_sinusoid():
    """Two tanks whose slosh both turns unstable inside the margin: no bound, however small the number looks."""
    other = SloshMass(name="b", slosh_mass=500.0, station=7.0, frequency=2.9, damping=PowerDamping(slope=0.5))
    review = assess(paper_case(more=(other,), criteria=Criteria(tvc_amplitude=0.1)))
    assert review.verdict == "invalid"
    assert any("no single oscillation" in reason or "modes grow at once" in reason for reason in review.reasons)


def test_a_slosh_mass_that_nothing_ever_damps_fails():
    """At the centre of percussion the loop does not see it, and its own damping is none at any amplitude."""
    review = assess(paper_case(xi(0.0), tank={"station": 15.375}))
    assert review.verdict == "fail"
    assert "never comes to rest" in review.reasons[0]


def test_with_a_rate_gain_alone_the_attitude_is_neutral_and_that_fails():
    review = assess(paper_case(attitude_gain=0.0))
    assert review.verdict == "fail"
    assert "rigid body mode is neutral" in review.reasons[0]
    assert limit_cycles(paper_case(attitude_gain=0.0))[0].stable


def test_a_loop_that_much_damping_makes_unstable_is_told_so():
    case = paper_case(delay=1.0)
    (reason,) = assess(case).tanks[0].limit_cycle.reasons
    said = re.search(r"stable with ([\d.]+) % damping of this tank, but with 30 % rigid body is unstable", reason)
    ratio = float(said.group(1)) / 100.0
    assert oracle.stable(oracle.numbers(case, ratio))
    assert not oracle.stable(oracle.numbers(case, 1.3 * ratio))  # the scan goes up in steps of a quarter
    assert not oracle.stable(oracle.numbers(case, 0.3))


def test_a_disc_margin_below_the_criterion_is_told_where_the_limit_cycle_passes(tmp_path):
    found = assess(read_case(write_example("flexible_launcher", tmp_path)))
    assert found.verdict == "pass"
    least = np.min(found.margins.minima.value)
    (told,) = [reason for reason in found.reasons if "with the damping given" in reason]
    assert told.startswith(f"core LOX slosh: disc margin {least:.3f} at 0.4992 Hz")
    assert "not margins" not in str(found)


def test_slosh_beyond_half_the_radius_is_told_once(tmp_path):
    found = assess(read_case(write_example("light_upper_stage", tmp_path)))
    assert len([reason for reason in found.reasons if "RP-1" in reason and "radius" in reason]) == 1
    assert "distances of a loop that is not stable from the critical point, not margins" in str(found)
