"""Unusual but legal cases: every question about them has an answer or a stated refusal, and the witnesses agree."""

import numpy as np
import pytest

import oracle
from cases import PAPER_LAW, PAPER_TANK, PowerDamping, paper_case, xi
from sloshpy.assess import assess
from sloshpy.autopilot import Actuator, Filter
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.dynamics.poles import unstable_count
from sloshpy.limit_cycle import limit_cycles
from sloshpy.simulation import simulate
from sloshpy.stability import margins, required_damping, required_damping_map, root_locus
from sloshpy.vehicle import SloshMass


def _filter(numerator, denominator):
    return {"filter": (Filter(numerator=numerator, denominator=denominator),)}


EDGES = {
    "no rate gain": paper_case(rate_gain=0.0),
    "slosh mass at the c.g.": paper_case(tank={"station": 6.0}),
    "slosh mass at the centre of percussion": paper_case(tank={"station": 15.375}),
    "stiff actuator": paper_case(actuator=Actuator(frequency=1e5, damping=0.7)),
    "delay of a microsecond": paper_case(delay=1e-6),
    "delay of a nanosecond": paper_case(delay=1e-9),
    "delay of 3 s": paper_case(delay=3.0),
    "filter with a zero on the right": paper_case(**_filter((-0.2, 1.0), (0.2, 1.0))),
    "unstable filter": paper_case(**_filter((1.0, 1.0), (1.0, -0.1))),
    "integrator": paper_case(**_filter((1.0, 0.05), (1.0, 0.0))),
    "static gain as a filter": paper_case(**_filter((2.0,), (1.0,))),
    "static gain of the wrong sign": paper_case(**_filter((-1.0,), (1.0,))),
    "undamped notch near slosh": paper_case(**_filter((1.0, 0.0, 4.5), (1.0, 2.0, 4.5))),
    "a million times heavier": paper_case(
        vehicle={"mass": 1.6e10, "inertia": 9e11, "thrust": 9e11}, tank={"slosh_mass": 1e9}
    ),
    "a million times lighter": paper_case(
        vehicle={"mass": 1.6e-2, "inertia": 0.9, "thrust": 0.9}, tank={"slosh_mass": 1e-3}
    ),
    "two equal tanks": paper_case(more=(SloshMass(**PAPER_TANK | {"name": "b"}, damping=PAPER_LAW),)),
}


@pytest.mark.parametrize("name", EDGES)
def test_verdict_witness_and_pole_list_agree_with_the_argument_principle(name):
    case = EDGES[name]
    loop = open_loop(case, damping=0.03)
    expected = oracle.unstable_poles(oracle.numbers(case, 0.03))
    found = margins(case, damping=0.03)
    poles = closed_loop_poles(loop).value
    assert unstable_count(loop) == expected
    assert found.trusted
    assert bool(found.stable) == (expected == 0)
    assert np.sum(np.where(poles.imag > 0, 2, 1)[poles.real > 0]) == expected


@pytest.mark.parametrize("name", EDGES)
def test_every_minimum_of_a_dense_grid_is_found(name):
    case = EDGES[name]
    grid = np.unique(np.concatenate([np.geomspace(0.06, 60, 200_001), 2.0 * (1 + np.linspace(-0.1, 0.1, 20_002))]))
    theirs, _ = oracle.disc_margin_minima(oracle.numbers(case, 0.03), grid)
    ours = margins(case, damping=0.03).minima
    for w, value, _ in theirs:
        k = np.nanargmin(np.abs(ours.omega - w))
        assert abs(ours.omega[k] / w - 1) < 1e-5
        assert abs(ours.value[k] - value) < 1e-6


@pytest.mark.parametrize("name", EDGES)
def test_every_question_has_an_answer_without_a_warning(name):
    case = EDGES[name]
    review = assess(case)
    assert review.verdict in ("pass", "fail", "invalid")
    review.to_json()
    at_three = assess(case, damping=0.03)  # undamped, some of these are exactly neutral and rightly without a verdict
    assert not any("WITNESS" in r for r in at_three.reasons)
    str(at_three)
    str(required_damping(case))
    str(root_locus(case))
    str(required_damping_map(case, station=np.linspace(0, 14, 5)))


@pytest.mark.parametrize(
    "name", [k for k in EDGES if k not in ("stiff actuator", "delay of a nanosecond", "delay of a microsecond")]
)
def test_a_short_simulation_runs(name):
    run = simulate(EDGES[name], duration=1.0)
    assert np.all(np.isfinite(run.slosh))


def test_units_scale_out():
    a, b = (
        margins(EDGES[k], damping=0.03).nichols_disc_margin
        for k in ("a million times heavier", "a million times lighter")
    )
    assert float(a) == pytest.approx(float(b), rel=1e-9) == pytest.approx(0.34, abs=1e-4)


def test_undamped_modes_that_control_does_not_reach_are_not_counted_as_growing():
    """Two equal tanks: the opposed mode is neutral at zero damping, only the common one grows."""
    cycles = [x for x in limit_cycles(EDGES["two equal tanks"]) if x.stable]
    assert len(cycles) == 1
    a, b = cycles[0].slosh_amplitude.values()
    assert a == pytest.approx(b, rel=1e-6)
    double = paper_case(PowerDamping(slope=0.1), tank={"slosh_mass": 2000.0})
    (alone,) = limit_cycles(double)
    assert a == pytest.approx(alone.slosh_amplitude["LOX"], rel=1e-6)


def test_an_undamped_loop_is_sampled_without_meeting_its_own_pole():
    found = margins(paper_case(xi(0.0), rate_gain=0.0))
    assert np.isfinite(found.nichols_disc_margin)


def test_a_loop_that_runs_along_minus_180_degrees_lists_no_rounding_as_crossings():
    found = margins(paper_case(rate_gain=0.0), 0.02)
    assert np.sum(np.isfinite(found.phase_crossings.omega)) <= 4
    neutral = closed_loop_poles(open_loop(paper_case(rate_gain=0.0), 0.0))
    assert not np.any(np.isfinite(neutral.time_to_double))
