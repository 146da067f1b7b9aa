"""Predictions and simulations are compared honestly: a wrong prediction would show."""

from dataclasses import replace

import numpy as np
import pytest

from cases import paper_case, xi
from sloshpy.damping import TableDamping
from sloshpy.files import read_case, write_example
from sloshpy.simulation import verify
from sloshpy.simulation import verify as verb
from sloshpy.vehicle import SloshMass


def test_the_example_agrees_within_a_thousandth_as_given_and_degraded():
    as_given, degraded = verify(paper_case())
    assert as_given.loop == "as given"
    assert as_given.predicted.slosh_amplitude["LOX"] == pytest.approx(0.2244, abs=5e-5)
    assert as_given.slosh["LOX"] == pytest.approx(0.2244, abs=1e-4)
    assert degraded.loop == "degraded by the margin of LOX"
    assert as_given.difference < 1e-3
    assert degraded.difference < 1e-3
    # the odd square law leaves a third harmonic of some tenths of a percent, not none
    assert 1e-4 < as_given.harmonics < 1e-2


def test_two_tanks_coupled_by_the_vehicle_agree():
    harmless = SloshMass(name="LH2", slosh_mass=800.0, station=-5.0, frequency=3.3, damping=xi(0.06))
    found = verify(paper_case(more=(harmless,)))
    assert len(found) == 2
    for one in found:
        assert set(one.slosh) == {"LOX", "LH2"}
        assert one.slosh["LH2"] > 0.01
        assert one.difference < 2e-3


def test_a_wrong_prediction_shows_as_a_difference():
    one = verify(paper_case())[0]
    wrong = replace(one.predicted, slosh_amplitude={"LOX": 1.1 * one.predicted.slosh_amplitude["LOX"]})
    assert replace(one, predicted=wrong).difference == pytest.approx(0.1, abs=2e-3)
    far = replace(one.predicted, slosh_amplitude={"LOX": 8.21 * one.slosh["LOX"]})
    assert "difference 7.21 times the simulated amplitude, other harmonics" in str(replace(one, predicted=far))
    assert "difference 9.98 %, other" in str(replace(one, predicted=wrong))


def test_an_unstable_cycle_is_listed_and_not_simulated():
    dips = TableDamping(
        amplitude=[0.0, 0.06, 0.15, 0.24, 0.3, 0.5, 0.8], ratio=[0.002, 0.0235, 0.03, 0.0236, 0.018, 0.03, 0.08]
    )
    as_given = [one for one in verify(paper_case(dips)) if one.loop == "as given"]
    assert [one.predicted.stable for one in as_given] == [True, False, True]
    assert as_given[1].reason == "not simulated: an unstable cycle repels"
    assert np.isnan(as_given[1].tvc)
    assert as_given[0].difference < 0.02  # the tabulated force has kinks, hence more harmonics
    assert as_given[2].difference < 0.02


def test_without_a_predicted_cycle_there_is_nothing_to_verify():
    assert verify(paper_case(xi(0.06))) == ()


def test_a_batch_is_refused():
    with pytest.raises(ValueError, match="one case"):
        verb(paper_case(vehicle={"mass": np.array([15000.0, 16000.0])}))


def test_tanks_that_ask_for_one_degradation_are_simulated_once(tmp_path):
    found = verify(read_case(write_example("two_tanks", tmp_path)))
    assert [one.loop for one in found] == ["as given", "degraded by the margin of LOX and of LH2"]
    assert all(one.difference < 2e-3 for one in found)
