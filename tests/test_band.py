"""The slosh-related band and the engine amplitude over it, against dense grids of a second implementation."""

from dataclasses import replace

import numpy as np
import pytest

import oracle_flexible as second
import oracle_verdict
from cases import lawful_case, paper_case
from sloshpy.case import Criteria
from sloshpy.dynamics.loop import open_loop
from sloshpy.files import read_case, write_example
from sloshpy.limit_cycle import five_steps, predict_limit_cycle
from sloshpy.limit_cycle.band import engine_per_slosh, inner_peak, plant_features, slosh_band
from sloshpy.stability.nichols import sampled


# 594: the peak is as narrow as 0.003 rad/s in a band of 1.8 rad/s; 1127: three tanks, of which one damps nothing
@pytest.mark.parametrize(
    ("number", "tank", "damping"),
    [
        (594, 0, [0.1]),
        (1127, 0, [0.055, 0.0982, 0.0107]),
        (1127, 1, [1.0, 0.03, 0.0107]),
        (4, 1, [0.0083, 0.0037, 0.0019, 0.079]),
    ],
)
def test_the_engine_amplitude_is_found_between_poles_and_zeros_of_the_plant(number, tank, damping):
    case = lawful_case(97, number)
    loop = open_loop(case, np.array(damping))
    band = slosh_band(loop, case.criteria, tank)
    assert len(band) > 0
    omega, found = engine_per_slosh(loop, tank, band)
    dense = np.concatenate([np.linspace(*interval, 200_001) for interval in band])
    wanted = 1.0 / np.abs(oracle_verdict.response(case, np.array(damping), dense)[1][:, tank])
    for power in (0, 1):  # the paper's convention, and oscillation at its own frequency
        one, other = found / omega**power, wanted / dense**power
        assert [one.min(), one.max()] == pytest.approx([other.min(), other.max()], rel=1e-4)
        assert one.min() <= other.min() * (1.0 + 1e-12)
        assert one.max() >= other.max() * (1.0 - 1e-12)
    near = oracle_verdict.distance(oracle_verdict.response(case, np.array(damping), dense)[0], case.criteria)
    assert np.max(near) < case.criteria.limit_cycle_disc_margin * (1.0 + 1e-9)


def test_poles_and_zeros_of_the_plant_are_those_of_the_second_implementation():
    for number in range(30):
        case = lawful_case(97, number)
        loop = open_loop(case, 0.02)
        for j in range(len(case.vehicle.tanks)):
            p = second.second_order(case.vehicle, loop.damping)
            for s in plant_features(loop, j):
                beside = np.array([s, s * (1.0 + 1e-6), s * (1.0 - 1e-6j), s * (1.0 + 1e-3)])
                z = np.abs(second.solved(p, case.autopilot, beside)[1][:, j])
                # at a pole far above, at a zero far below what it is a thousandth beside it
                assert z[0] > 1e2 * z[3] or z[0] < 1e-2 * z[3], (number, j, s)


def test_a_band_that_reaches_down_to_rest_is_a_band():
    case = paper_case()
    loop = open_loop(case, 0.05)
    narrow = slosh_band(loop, case.criteria, 0)
    assert narrow.shape == (1, 2)
    wide = slosh_band(loop, Criteria(limit_cycle_disc_margin=1e3), 0)
    curve = sampled(loop, case.criteria.gain_margin, case.criteria.phase_margin)
    assert wide == pytest.approx(np.array([[curve.omega[0], curve.omega[-1]]]))


def test_an_undamped_zero_leaves_no_bound(tmp_path):
    loop = open_loop(read_case(write_example("two_tanks", tmp_path)), np.array([0.05, 0.0]))
    zeros = [s for s in plant_features(loop, 0) if abs(s.real) < 1e-9 * abs(s)]
    assert zeros
    at = abs(zeros[0].imag)
    omega, ratio = engine_per_slosh(loop, 0, np.array([[0.97 * at, 1.02 * at]]))
    assert np.max(ratio) > 1e6 * np.median(ratio)
    assert np.all(np.diff(omega) > 0.0)


def test_a_peak_inside_a_band_is_told_from_a_rise_towards_its_end():
    band = np.array([[1.0, 2.0], [3.0, 4.0]])
    omega = np.concatenate([np.linspace(*interval, 101) for interval in band])
    assert inner_peak(omega, omega, band) is None
    assert inner_peak(omega, 1.0 / np.abs(omega - 3.4 + 0.01j), band) == pytest.approx(3.4)
    assert inner_peak(omega, 1.0 / np.abs(omega - 3.99 + 0.01j), band) is None  # as great at the end


def test_the_answer_says_where_a_zero_of_the_plant_sets_it_and_that_no_small_angle_is_left():
    one = predict_limit_cycle(paper_case())
    reasons = five_steps._caution_of_zero(
        "LOX", np.array([1.0, 1.5, 2.0]), np.array([1.0, 9.0, 2.0]), np.array([[1.0, 2.0]])
    )
    assert reasons[0].startswith(
        "caution: its greatest engine angle is near a zero of the plant, at 0.2387 Hz, where LOX"
    )
    wide = replace(one, tvc_amplitude=np.array([0.02, 3.0]))
    assert "20.000 to beyond 1571 mrad (1.146 to beyond 90 deg)" in wide.summary()
