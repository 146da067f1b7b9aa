"""Cases compare by what they describe, tanks go by name or number, and one thing is not asked twice."""

import numpy as np
import pytest
from pydantic import ValidationError

from cases import PAPER_LAW, paper_case, xi
from sloshpy.damping import TableDamping
from sloshpy.dynamics import open_loop
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_case, write_case, write_example
from sloshpy.limit_cycle import growth_curve, predict_limit_cycle
from sloshpy.stability import damping_sweep, danger_zone
from sloshpy.tank import Tank
from sloshpy.vehicle import SloshMass, Vehicle


def test_a_case_equals_its_copy_through_a_file(tmp_path):
    case = read_case(write_example("two_tanks", tmp_path))
    again = read_case(write_case(case, tmp_path / "again.toml"))
    assert again.source != case.source
    assert again == case
    assert again != case.model_copy(update={"name": "other"})


def test_tables_compare_row_by_row():
    one = TableDamping(amplitude=[0.0, 1.0], ratio=[0.0, 0.1])
    assert one == TableDamping(amplitude=[0.0, 1.0], ratio=[0.0, 0.1])
    assert one != TableDamping(amplitude=[0.0, 1.0], ratio=[0.0, 0.2])
    assert one != PAPER_LAW
    assert paper_case(one) == paper_case(TableDamping(amplitude=[0.0, 1.0], ratio=[0.0, 0.1]))


def test_a_tank_goes_by_its_name_or_number():
    other = SloshMass(name="b", slosh_mass=100.0, station=7.0, frequency=2.9, damping=PAPER_LAW)
    case = paper_case(more=(other,))
    assert predict_limit_cycle(case, "b").tank == "b"
    assert danger_zone(case, "b").l == danger_zone(case, 1).l
    assert growth_curve(case, "b", np.array([0.1])).tank == "b"
    assert damping_sweep(case, (0.01, 0.02), tank="b").tank == 1
    for verb in (predict_limit_cycle, danger_zone, growth_curve):
        with pytest.raises(ValueError, match="this vehicle has LOX, b"):
            verb(case, "LH2")


def test_damping_and_amplitude_are_not_both_given_and_no_law_goes_beyond_critical():
    with pytest.raises(ValueError, match="damping or amplitude"):
        open_loop(paper_case(), damping=0.01, amplitude=0.1)
    with pytest.raises(OutsideValidity, match="more than critical"):
        open_loop(paper_case(), amplitude=1e9)
    assert open_loop(paper_case(xi(0.01)), amplitude=1e9).damping == pytest.approx([0.01])


def test_a_tank_is_refused_in_python_as_the_other_nouns_are_with_rule_and_cure():
    shape = {"kind": "sphere", "radius": 2.0}
    given_tank = {"name": "LOX", "liquid": {"density": 1141.0}, "shape": shape}
    for noun, given, rule in (
        (Vehicle, {"mass": -1.0}, "must be > 0 kg. Cure: drop the sign."),
        (
            Tank,
            given_tank | {"acceleration": -1.0, "fill": 1.0},
            "must be > 0 m/s^2. Cure: ",
        ),
        (
            Tank,
            given_tank | {"acceleration": 9.81, "fill": 5.0},
            "must be < 4 m, the height of",
        ),
    ):
        with pytest.raises(ValidationError) as caught:
            noun(**given)
        assert isinstance(caught.value, ValueError)
        (fault,) = [one for one in caught.value.errors() if one["type"] == "quantity"]
        assert rule in fault["msg"]
