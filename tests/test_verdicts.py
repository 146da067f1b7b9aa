"""Whole assessments, as JSON, hold in the equations of a second implementation; 2,000 in `benchmarks/verdicts.py`."""

import json

import pytest

import oracle_verdict
from cases import lawful_case
from sloshpy.cli import main
from sloshpy.files import read_case, write_case
from sloshpy.limit_cycle import predict_limit_cycle
from sloshpy.stability import joint_damping


def test_every_number_and_the_verdict_of_an_assessment_hold_in_the_second_implementation(tmp_path, capsys):
    tally = oracle_verdict.tally()
    for k in range(40):
        path = write_case(lawful_case(97, k), tmp_path / f"{k}.toml")
        with pytest.raises(SystemExit) as stopped:
            main(["assess", str(path), "--json"])
        printed = capsys.readouterr()
        assert stopped.value.code in (0, 1), printed.err
        case = read_case(path)
        assert oracle_verdict.compare(case, json.loads(printed.out), joint_damping(case), tally) == [], k
    assert min(tally[f"verdict {word}"] for word in ("pass", "fail", "invalid")) > 0
    assert min(tally["margin reached to 1e-6"], tally["cycle as given"], tally["coupled cycle"]) > 0
    assert tally["minimum listed"] > 100


# dips of 4e-4, 3e-5 and 7e-5, seen before and gone behind the damping that is needed
@pytest.mark.parametrize(("number", "tank", "needed"), [(56, 3, 0.010337), (26, 2, 0.0118), (59, 1, 0.0067)])
def test_a_requirement_that_the_end_of_a_shallow_minimum_sets_is_found(number, tank, needed):
    case = lawful_case(97, number)
    joint = joint_damping(case)
    found = predict_limit_cycle(case, tank, joint)
    assert float(found.required.required) == pytest.approx(needed, rel=0.01)

    def least(ratio):
        damping = joint.copy()
        damping[tank] = ratio
        listed = oracle_verdict.minima(case, damping, 1.0)
        own = [v for w, v in listed if oracle_verdict.belongs(oracle_verdict.shares(case, damping, w), tank)]
        return min(own, default=9.0)

    ratio = float(found.required.required)
    assert least(0.98 * ratio) < 1.0 - 1e-3  # not a margin that is reached
    assert least(1.02 * ratio) == 9.0


def test_a_requirement_that_ends_with_a_minimum_says_so():
    case = lawful_case(97, 56)
    found = predict_limit_cycle(case, 3, joint_damping(case))
    assert found.acceptable is None
    assert "ends or becomes another mode's" in found.reasons[0]
    assert "0.890 at 0.3359 Hz" in found.reasons[0]
