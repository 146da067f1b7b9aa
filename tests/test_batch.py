"""A verb for one case, asked of each case of a batch and along further axes."""

import numpy as np
import pytest

import sloshpy
from cases import paper_case, xi
from sloshpy.batch import case_shape, for_each
from sloshpy.damping import TableDamping
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.limit_cycle import limit_cycles, predict_limit_cycle
from sloshpy.simulation import simulate
from sloshpy.stability import root_locus
from sloshpy.vehicle import SloshMass

MASSES = np.array([15500.0, 16000.0, 17000.0])
DELAYS = np.array([[0.0], [0.13]])


def test_the_limit_cycles_of_a_batch_equal_a_loop_over_its_cases():
    answers = for_each(predict_limit_cycle, paper_case(vehicle={"mass": MASSES}, delay=DELAYS))
    assert answers.shape == (2, 3)
    slosh, engine, band = (answers.values(n) for n in ("slosh_amplitude", "tvc_amplitude", "band"))
    assert (slosh.shape, engine.shape, band.shape) == ((2, 3), (2, 3, 2), (2, 3, 1, 2))
    for i, j in np.ndindex(2, 3):
        one = predict_limit_cycle(paper_case(vehicle={"mass": MASSES[j]}, delay=DELAYS[i, 0]))
        assert answers[i, j].tvc_amplitude == pytest.approx(one.tvc_amplitude, rel=1e-12)
        assert slosh[i, j] == answers[i, j].slosh_amplitude
        assert answers.values("required.neutral")[i, j] == pytest.approx(float(one.required.neutral), rel=1e-12)
    assert len(set(slosh.ravel())) == 6  # the cases do differ


def test_a_damping_axis_alone_and_with_a_batch():
    alone = for_each(root_locus, paper_case(), np.array([0.0, 0.02]))
    assert alone.shape == (2,)
    np.testing.assert_array_equal(alone[1].branch, root_locus(paper_case(), 0.02).branch)
    both = for_each(
        lambda case, xi: closed_loop_poles(open_loop(case, xi)),
        paper_case(vehicle={"mass": MASSES}),
        np.array([[0.0], [0.02]]),
    )
    expected = closed_loop_poles(open_loop(paper_case(vehicle={"mass": MASSES[2]}), 0.02)).value
    np.testing.assert_allclose(both[1, 2].value, expected, rtol=1e-13)
    assert both.values("value").shape == (2, 3, len(expected))


def test_a_batch_over_tanks_and_gains_gives_single_floats_to_the_verb():
    def given(case):
        v, a = case.vehicle, case.autopilot
        assert case_shape(case) == ()
        return np.array([v.mass, v.tanks[0].station, v.tanks[1].frequency, a.delay, a.attitude_gain])

    other = SloshMass(name="B", slosh_mass=500.0, station=3.0, frequency=np.array([2.5, 3.0, 3.5]), damping=xi(0.01))
    stations, delays = np.array([8.0, 9.0, 10.0]), np.array([[0.0], [0.1]])
    found = for_each(given, paper_case(tank={"station": stations}, more=(other,), delay=delays))
    assert [list(row) for row in found] == [
        [16000.0, x, f, d, 0.08] for d in (0.0, 0.1) for x, f in ((8.0, 2.5), (9.0, 3.0), (10.0, 3.5))
    ]


def test_the_rows_of_a_damping_table_are_no_batch():
    law = TableDamping(amplitude=np.array([0.0, 0.5, 1.0]), ratio=np.array([0.0, 0.05, 0.1]))
    case = paper_case(law)
    assert case_shape(case) == ()
    assert for_each(predict_limit_cycle, case)[()].slosh_amplitude == predict_limit_cycle(case).slosh_amplitude


def test_simulations_of_a_batch_equal_single_runs_and_shorter_ones_are_filled_up():
    durations = np.array([20.0, 15.0])
    runs = for_each(simulate, paper_case(delay=DELAYS[:, 0]), durations)
    for k, delay in enumerate(DELAYS[:, 0]):
        np.testing.assert_array_equal(runs[k].slosh, simulate(paper_case(delay=delay), durations[k]).slosh)
    times = runs.values("time")
    longest = max(len(run.time) for run in runs)
    assert times.shape == (2, longest)
    assert np.isnan(times).sum() == sum(longest - len(run.time) for run in runs) > 0


def test_what_is_no_number_is_not_stacked():
    answers = for_each(predict_limit_cycle, paper_case(vehicle={"mass": MASSES}))
    with pytest.raises(TypeError, match="tank is no number"):
        answers.values("tank")
    assert answers.values("acceptable").tolist() == [float(one.acceptable) for one in answers]


@pytest.mark.parametrize(
    "verb",
    ["predict_limit_cycle", "growth_curve", "root_locus", "simulate", "damping_sweep", "assess", "verify"],
)
def test_a_verb_for_one_case_names_the_way_for_a_batch(verb):
    with pytest.raises(ValueError, match=rf"batch of shape \(3,\): for_each\({verb}, case\)"):
        getattr(sloshpy, verb)(paper_case(vehicle={"mass": MASSES}))


def test_limit_cycles_of_a_batch_are_refused_too():
    with pytest.raises(ValueError, match="for_each"):
        limit_cycles(paper_case(vehicle={"mass": MASSES}))
