"""The degradation map against the full search in single cells, the five steps and the harmonic balance."""

import time

import numpy as np
import pytest

import oracle
from cases import paper_case, xi
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.errors import NoAttractor, OutsideValidity
from sloshpy.files import read_case, write_example
from sloshpy.limit_cycle import degradation_map, limit_cycles, predict_limit_cycle
from sloshpy.limit_cycle.degraded_cycles import CYCLE, DIVERGES, REST, SEVERAL, UNSUPPORTED, DegradedCycles
from sloshpy.vehicle import SloshMass

DIP = TableDamping(amplitude=[0.0, 0.07, 0.15, 0.3, 0.5, 0.8], ratio=[0.005, 0.026, 0.029, 0.020, 0.030, 0.045])
SHORT = TableDamping(amplitude=[0.0, 0.1, 0.2], ratio=[0.001, 0.02, 0.035])
FLOOR = SumDamping(of=(ConstantDamping(ratio=0.02), PowerDamping(slope=0.1)))
GAIN, DELAY = np.linspace(-7.0, 7.0, 6), np.linspace(0.0, 0.3, 5)


def full(case, gain_db, delay):
    """Greatest stable cycle by the whole growth curve, 0 without one, nan where several modes grow."""
    degraded = case.autopilot.degraded(10 ** (gain_db / 20), delay)
    try:
        found = limit_cycles(case.model_copy(update={"autopilot": degraded}))
    except NoAttractor:
        return 0.0
    except OutsideValidity:
        return np.nan
    return max((cycle.tvc_amplitude for cycle in found if cycle.stable), default=0.0)


@pytest.mark.parametrize(
    ("law", "codes"),
    [
        (PowerDamping(slope=0.1), {CYCLE}),
        (FLOOR, {CYCLE, REST}),
        (DIP, {CYCLE, UNSUPPORTED}),
        (SHORT, {CYCLE, UNSUPPORTED}),
        (PowerDamping(slope=0.1, largest_amplitude=0.3), {CYCLE, UNSUPPORTED}),
        (xi(0.02), {REST, DIVERGES}),
    ],
    ids=["power", "wall and power", "several cycles", "short table", "formula that ends", "constant"],
)
def test_every_fifth_cell_equals_the_full_search(law, codes):
    case = paper_case(law)
    found = degradation_map(case, gain_db=GAIN, delay=DELAY)
    assert set(np.unique(found.reason)) == codes
    for k in range(0, found.tvc.size, 5):
        g, d = (k // 5, k // 5 % 5)  # one cell of each gain, the delay moving along
        wanted, here = full(case, GAIN[g], DELAY[d]), found.tvc[g, d]
        if found.reason[g, d] in (UNSUPPORTED, DIVERGES):
            assert wanted == 0.0
            assert np.isinf(here) == (found.reason[g, d] == DIVERGES)
        else:
            assert here == pytest.approx(wanted, rel=1e-7, abs=1e-15)


def test_two_coupled_tanks_equal_the_full_search(tmp_path):
    case = read_case(write_example("two_tanks", tmp_path))
    gain_db, delay = np.array([-3.0, 1.0, 5.0]), np.array([0.0, 0.1])
    found = degradation_map(case, tank=1, gain_db=gain_db, delay=delay)
    for g, d in ((0, 1), (2, 0)):
        assert found.tvc[g, d] == pytest.approx(full(case, gain_db[g], delay[d]), rel=1e-7)
    # the engine does not care which tank's amplitude is asked for
    other = degradation_map(case, tank=0, gain_db=gain_db, delay=delay)
    np.testing.assert_allclose(found.tvc, other.tvc, rtol=1e-9)
    assert not np.allclose(found.slosh, other.slosh, rtol=0.01)


def test_each_cell_balances_in_the_oracle():
    case = paper_case()
    found = degradation_map(case, gain_db=GAIN, delay=DELAY)
    for g, d in np.ndindex(found.tvc.shape):
        autopilot = case.autopilot.degraded(10 ** (GAIN[g] / 20), DELAY[d])
        c = oracle.numbers(case.model_copy(update={"autopilot": autopilot}), 0.0)
        W, A = found.omega[g, d], found.slosh[g, d]
        L, z = oracle.solved(c.damped(0.1 * W * A / 2.0), np.array(1j * W))
        assert abs(1.0 + L) < 1e-8
        assert A / abs(z[0]) == pytest.approx(found.tvc[g, d], rel=1e-8)


def test_where_several_modes_grow_there_is_no_number():
    second = SloshMass(name="b", slosh_mass=700.0, station=8.0, frequency=2.8, damping=PowerDamping(slope=0.1))
    found = degradation_map(paper_case(more=(second,)), gain_db=GAIN, delay=DELAY)
    assert np.all(found.reason == SEVERAL)
    assert np.all(np.isnan(found.tvc))
    assert "simulate it" in str(found)
    assert np.isnan(found.worst_inside)


def test_rest_is_not_claimed_below_the_first_row_of_a_table():
    late = TableDamping(amplitude=[0.2, 0.9], ratio=[0.03, 0.09])
    found = degradation_map(paper_case(late), gain_db=GAIN, delay=DELAY)
    full_table = degradation_map(paper_case(PowerDamping(slope=0.1)), gain_db=GAIN, delay=DELAY)
    assert REST not in found.reason  # undamped the loop is unstable: there is a cycle below 0.2 m, of unknown size
    assert np.isnan(found.tvc[0, 0])
    assert full_table.slosh[0, 0] < 0.2


def test_the_papers_point_is_the_five_steps():
    case = paper_case()
    paper = predict_limit_cycle(case)
    found = degradation_map(case, gain_db=np.array([0.0, paper.gain_db]), delay=np.array([0.0, paper.delay]))
    assert found.point == (paper.gain_db, paper.delay)
    assert found.slosh[1, 1] == pytest.approx(paper.slosh_amplitude, rel=1e-6)
    assert found.omega[1, 1] == pytest.approx(paper.omega, rel=1e-6)
    assert found.tvc[1, 1] == pytest.approx(found.point_tvc, rel=1e-6)
    assert paper.tvc_amplitude[0] <= found.point_tvc <= paper.tvc_amplitude[1]
    assert found.tvc[0, 0] == pytest.approx(limit_cycles(case)[0].tvc_amplitude, rel=1e-9)


def test_on_the_ellipse_the_papers_point_has_the_greatest_slosh_velocity():
    """Theory, section 6: the threshold damping is the largest that any degradation inside the ellipse asks for."""
    case = paper_case()
    paper = predict_limit_cycle(case)
    found = degradation_map(case)
    gain_db, delay = found.ellipse
    field = DegradedCycles(case, 0, 10 ** (found.gain_db / 20), found.delay)
    field.fill()
    tvc, slosh, omega = field.along(10 ** (gain_db / 20), delay)
    np.testing.assert_array_equal(tvc, found.ellipse_tvc)
    wanted = slosh * omega
    greatest = paper.slosh_amplitude * paper.omega
    # 2e-3: the ellipse turns phase into delay at one frequency, and a cycle's own differs by up to 1 %
    assert np.max(wanted) == pytest.approx(greatest, rel=2e-3)
    assert np.min(wanted) < 0.3 * greatest
    # engine amplitude also falls with |z/beta|, which turns the greatest a little along the ellipse
    assert np.max(found.ellipse_tvc) == pytest.approx(found.point_tvc, rel=5e-3)
    assert found.worst_inside == pytest.approx(np.max(found.ellipse_tvc), rel=1e-12)
    assert np.max(found.tvc[found.inside]) < found.worst_inside


def test_a_map_of_the_example_takes_less_than_ten_seconds():
    case = paper_case()
    start = time.process_time()
    found = degradation_map(case)
    assert time.process_time() - start < 10.0
    assert found.tvc.shape == (21, 21)


def test_a_batch_is_refused():
    with pytest.raises(ValueError, match="one case"):
        degradation_map(paper_case(vehicle={"mass": np.array([15000.0, 16000.0])}))
