"""The paper's numbers with their printed precision, and the same quantities computed closely."""

import json

import numpy as np
import pytest

import oracle
from cases import PAPER_LAW, paper_case
from sloshpy.assess import assess
from sloshpy.damping import PowerDamping
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.limit_cycle import limit_cycles, predict_limit_cycle
from sloshpy.simulation import simulate
from sloshpy.stability import danger_zone, margins, required_damping

HZ = 2 * np.pi


def points(p):
    ok = np.isfinite(p.omega)
    return p.omega[ok] / HZ, p.value[ok]


def test_danger_zone_is_13_18_m_behind_and_9_37_m_ahead():
    zone = danger_zone(paper_case())
    assert round(zone.aft, 2) == 13.18
    assert abs(-zone.forward - 9.37) <= 0.0051  # 9.375 printed as 9.37
    assert zone.aft == pytest.approx(13.1836, abs=5e-5)
    assert zone.forward == pytest.approx(-9.3750, abs=5e-5)


def test_crossover_is_0_17_hz():
    f, _ = points(margins(paper_case(), damping=0.048).gain_crossings)
    assert round(f[0], 2) == 0.17
    assert f[0] == pytest.approx(0.1718, abs=5e-5)


def test_slosh_mode_is_at_about_0_35_hz_twice_the_crossover():
    pole = closed_loop_poles(open_loop(paper_case(), damping=0.048))
    f = pole.value[pole.kind.index("slosh")].imag / HZ
    assert f == pytest.approx(0.35, abs=0.015)


def test_one_percent_is_unstable_with_a_distance_of_1_2892_at_0_3382_hz():
    found = margins(paper_case(), damping=0.01)
    assert not found.stable
    f, v = points(found.minima)
    assert v[0] == pytest.approx(1.2892, abs=5e-5)
    assert f[0] == pytest.approx(0.3382, abs=5e-5)


def test_three_percent_is_stable_but_not_robust_and_not_ample():
    found = margins(paper_case(), damping=0.03)
    assert found.stable
    f, v = points(found.minima)
    assert v[0] == pytest.approx(0.3400, abs=5e-5)
    assert f[0] == pytest.approx(0.3398, abs=5e-5)
    f, ratio = points(found.phase_crossings)
    db = -20 * np.log10(ratio)  # of |L|
    order = np.argsort(-db)
    assert db[order[0]] == pytest.approx(-2.58, abs=5e-3)
    assert f[order[0]] == pytest.approx(0.3413, abs=5e-5)
    assert db[order[1]] == pytest.approx(-13.07, abs=5e-3)


def test_neutral_damping_of_the_nominal_loop_is_2_3929_percent():
    neutral = float(required_damping(paper_case()).neutral)
    assert neutral == pytest.approx(0.023929, abs=5e-7)
    pole = closed_loop_poles(open_loop(paper_case(), damping=neutral)).value[0]
    assert pole.imag == pytest.approx(2.132783, abs=5e-7)
    assert abs(pole.real) < 1e-8  # neutral is told from growing at 1e-9 of the slosh frequency


@pytest.mark.parametrize(
    ("ratio", "pole", "double"), [(0.0, 0.05113 + 2.13421j, 13.56), (0.01, 0.02976 + 2.13377j, 23.29)]
)
def test_closed_loop_slosh_poles_and_times_to_double(ratio, pole, double):
    value = closed_loop_poles(open_loop(paper_case(), damping=ratio)).value[0]
    assert value.real == pytest.approx(pole.real, abs=5e-6)
    assert value.imag == pytest.approx(pole.imag, abs=5e-6)
    assert np.log(2) / value.real == pytest.approx(double, abs=5e-3)


def test_nominal_limit_cycle_is_0_2244_m_1_212_mrad_at_0_3394_hz():
    """T23: consistent frequency; the paper's convention gives 0.2393 m."""
    (cycle,) = limit_cycles(paper_case())
    assert cycle.stable
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(0.2244, abs=5e-5)
    assert cycle.tvc_amplitude == pytest.approx(1.212e-3, abs=5e-7)
    assert cycle.omega / HZ == pytest.approx(0.3394, abs=5e-5)
    assert cycle.slosh_amplitude["LOX"] * cycle.omega / 2.0 == pytest.approx(0.2393, abs=5e-5)


def test_nominal_limit_cycle_by_simulation():
    run = simulate(paper_case(), duration=260.0, initial_slosh=0.25)
    assert run.slosh_envelope().amplitude == pytest.approx(0.2244, rel=1e-3)
    assert run.tvc_envelope.amplitude == pytest.approx(1.212e-3, rel=1e-3)
    assert run.slosh_envelope().omega / HZ == pytest.approx(0.3394, rel=1e-3)


def test_printed_alpha_of_0_01_gives_2_24_m():
    """T23: the printed slope is a factor ten off its own figures."""
    (cycle,) = limit_cycles(paper_case(PowerDamping(slope=0.01)))
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(2.244, abs=5e-4)


def test_required_damping_is_4_8_percent():
    needed = float(required_damping(paper_case()).required)
    assert abs(needed - 0.048) < 1e-3  # read off a figure
    assert needed == pytest.approx(0.047358, abs=5e-7)
    assert float(margins(paper_case(), damping=0.048).nichols_disc_margin) == pytest.approx(1.0183, abs=5e-5)


def test_band_is_0_336_to_0_343_hz():
    low, high = predict_limit_cycle(paper_case()).band[0] / HZ
    assert round(low, 3) == 0.336
    assert abs(high - 0.343) < 1e-3
    assert low == pytest.approx(0.33588, abs=5e-6)
    assert high == pytest.approx(0.34360, abs=5e-6)


def test_engine_amplitude_is_about_5_mrad_or_0_3_deg_by_the_papers_convention():
    """T30: the greatest over the band, 5.334 mrad, is what step 5 compares."""
    found = predict_limit_cycle(paper_case())
    low, high = found.paper_tvc_amplitude
    assert round(1e3 * low) == round(1e3 * high) == 5
    assert round(np.degrees(high), 1) == 0.3
    assert low == pytest.approx(4.978e-3, abs=5e-7)
    assert high == pytest.approx(5.334e-3, abs=5e-7)
    assert found.acceptable is True


def test_frequency_consistent_engine_amplitude_is_lower_by_the_frequency_ratio():
    found = predict_limit_cycle(paper_case())
    for k, side in ((0, 0), (1, 1)):
        ratio = found.tvc_amplitude[k] / found.paper_tvc_amplitude[k]
        edges = 2.0 / found.band[0]
        assert edges.min() * (1 - 1e-9) <= ratio <= edges.max() * (1 + 1e-9), side
    c = oracle.numbers(paper_case(), float(found.required.required))
    w = np.linspace(*found.band[0], 20001)
    paper = found.paper_slosh_amplitude / np.abs(oracle.solved(c, 1j * w)[1][:, 0])
    np.testing.assert_allclose(found.paper_tvc_amplitude, [paper.min(), paper.max()], rtol=1e-5)
    np.testing.assert_allclose(found.tvc_amplitude, [(paper * 2 / w).min(), (paper * 2 / w).max()], rtol=1e-5)


def test_slosh_amplitude_is_0_48_m_by_the_paper_and_0_444_m_consistently():
    found = predict_limit_cycle(paper_case())
    assert abs(found.paper_slosh_amplitude - 0.48) < 0.01
    assert found.paper_slosh_amplitude == pytest.approx(0.47358, abs=5e-6)
    assert found.slosh_amplitude == pytest.approx(0.444, abs=1e-3)


def test_degradation_to_neutral_is_4_4_db_and_170_ms_at_0_34_hz():
    found = predict_limit_cycle(paper_case())
    assert abs(found.gain_db - 4.4) < 0.1
    assert abs(found.delay - 0.170) < 1e-3
    assert round(found.omega / HZ, 2) == 0.34
    assert found.gain_db == pytest.approx(4.304, abs=5e-4)
    assert found.delay == pytest.approx(0.1709, abs=5e-5)
    assert found.omega / HZ == pytest.approx(0.3398, abs=5e-5)
    pilot = paper_case().autopilot.degraded(found.gain, found.delay)
    case = paper_case().model_copy(update={"autopilot": pilot})
    pole = closed_loop_poles(open_loop(case, damping=float(found.required.required))).value
    assert np.abs(pole - 1j * found.omega).min() < 1e-6


def test_degraded_simulation_cycles_with_0_4466_m_and_4_796_mrad():
    case = paper_case(gain=10 ** (4.4 / 20), delay=0.170)
    run = simulate(case, duration=300.0, initial_slosh=0.4)
    assert run.slosh_envelope().amplitude == pytest.approx(0.4466, rel=3e-4)
    assert run.tvc_envelope.amplitude == pytest.approx(4.796e-3, rel=3e-4)
    assert round(1e3 * run.tvc_envelope.amplitude) == 5
    # the paper reads about 0.48 m off its figure; its own simulation must have been near this
    assert abs(run.slosh_envelope().amplitude - 0.48) < 0.04


def test_degraded_cycle_grows_in_about_100_s():
    case = paper_case(gain=10 ** (4.4 / 20), delay=0.170)
    run = simulate(case, duration=150.0, initial_slosh=0.03)
    z = np.abs(run.slosh[:, 0])
    early, late = z[(run.time > 20) & (run.time < 30)].max(), z[(run.time > 90) & (run.time < 100)].max()
    assert early < 0.8 * 0.4466  # T27: a run this short has not settled
    assert late > 0.95 * 0.4466


def test_circular_motion_factor_of_the_square_law():
    """Section 6: 3 pi/8 times the damping makes the nominal circular cycle 0.1905 m."""
    stronger = PowerDamping(slope=0.1 * 3 * np.pi / 8)
    (cycle,) = limit_cycles(paper_case(stronger))
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(0.1905, abs=5e-5)
    assert cycle.slosh_amplitude["LOX"] / 0.2244 == pytest.approx(0.849, abs=5e-4)


def test_the_whole_review_of_the_example_passes_the_papers_criteria():
    found = assess(paper_case(PAPER_LAW))
    assert found.verdict == "pass"
    tank = json.loads(found.to_json())["tanks"][0]
    assert tank["required_damping"] == pytest.approx(0.047358, abs=5e-7)
    assert tank["limit_cycle"]["paper"]["tvc_amplitude_rad"][1] == pytest.approx(5.334e-3, abs=5e-7)
