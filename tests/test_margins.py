"""Every crossing and every minimum of eq 24, none missed and none invented, signed by stability."""

import control
import numpy as np
import pytest

import oracle
import oracle_verdict
from cases import PAPER_LAW, paper_case, random_case, xi
from sloshpy.autopilot import Actuator
from sloshpy.stability import margins
from sloshpy.vehicle import Aerodynamics, SloshMass
from test_loop import _varied, pick

GRID = 1_000_000


def _points(points):
    ok = np.isfinite(points.omega)
    return points.omega[ok], points.value[ok]


def _matched(rng, n_cases, check):
    for k in range(n_cases):
        case, damping = random_case(rng, tanks=1 + k % 3, delay=k % 2 == 1)
        c = oracle.numbers(case, damping)
        check(k, case, damping, c)


def test_every_local_minimum_of_a_million_point_grid_is_found_and_nothing_is_invented_on_200_vehicles():
    """T02, T03: damping down to 1e-4, 1 to 3 tanks, every second one with a delay.

    The grid is 9 points to the narrowest half-width; a minimum it shows is refined inside its own two cells.
    """

    def check(k, case, damping, c):
        grid = np.geomspace(0.03 * c.w.min(), 30 * c.w.max(), GRID)
        found = margins(case, damping=damping)
        omega, value = _points(found.minima)
        theirs, _ = oracle.disc_margin_minima(c, grid)
        for w, refined, on_grid in theirs:
            near = np.argmin(np.abs(omega - w) / w)
            assert value[near] <= on_grid + 1e-9, (k, w, on_grid, omega, value)
            # two frequencies of one minimum differ by the root of the rounding of its value
            assert abs(omega[near] / w - 1) < 1e-5, (k, w, refined, omega, value)
            assert abs(value[near] - refined) < 1e-6, (k, w, refined, value[near])
        inside = (omega > 1.001 * grid[0]) & (omega < 0.999 * grid[-1]) & (value < 4.0 - 1e-6)
        theirs_w = np.array([w for w, _, _ in theirs])
        for w, v in zip(omega[inside], value[inside], strict=True):
            # ours is a minimum: both neighbours are higher, by more than rounding where the grid did not see it
            if len(theirs_w) == 0 or np.abs(theirs_w / w - 1).min() > 1e-5:
                step = 1e-4 * w * min(1e-2, damping.min())
                around = oracle.disc_margin(oracle.loop(c, 1j * (w + step * np.array([-1, 0, 1]))))
                assert around[1] <= min(around[0], around[2]) + 1e-9, (k, w, v)
                pytest.fail(f"case {k}: minimum {v} at {w} is not on the grid")

    _matched(np.random.default_rng(30), 200, check)


def test_every_gain_and_phase_crossing_of_a_grid_is_found_and_nothing_is_invented_on_200_vehicles():
    """T09: all of them, phase crossings within 40 dB."""

    def check(k, case, damping, c):
        grid = np.geomspace(0.03 * c.w.min(), 30 * c.w.max(), GRID // 10)
        cluster = [w * (1 + np.linspace(-0.05, 0.05, 20001)) for w in c.w]
        grid = np.unique(np.concatenate([grid, *cluster]))
        found = margins(case, damping=damping)
        gain, phase = oracle.crossings(c, grid)
        ratio = 1 / np.abs(oracle.loop(c, 1j * phase))
        phase, ratio = phase[np.abs(np.log10(ratio)) < 1.99], ratio[np.abs(np.log10(ratio)) < 1.99]
        for ours, theirs in ((found.gain_crossings, gain), (found.phase_crossings, phase)):
            omega, value = _points(ours)
            for w in theirs:
                assert np.abs(omega / w - 1).min() < 1e-8, (k, w, omega)
            inside = (omega > grid[0]) & (omega < grid[-1])
            if ours is found.phase_crossings:
                inside &= np.abs(np.log10(value)) < 1.99
            assert np.sum(inside) == len(theirs), (k, omega[inside], theirs)
        omega, value = _points(found.gain_crossings)
        L = oracle.loop(c, 1j * omega)
        np.testing.assert_allclose(np.abs(L), 1.0, rtol=1e-8)
        np.testing.assert_allclose(np.abs(np.angle(-L * np.exp(-1j * value))), 0.0, atol=1e-7)
        omega, value = _points(found.phase_crossings)
        np.testing.assert_allclose(-1 / oracle.loop(c, 1j * omega).real, value, rtol=1e-6)

    _matched(np.random.default_rng(31), 200, check)


def test_margin_carries_the_sign_of_closed_loop_stability():
    """T01: DM is a distance; below 2.393 % every one of these is measured from the unstable side."""
    table = {0.0: 1.865, 0.008: 1.61, 0.01: 1.289, 0.012: 1.025, 0.02: 0.27, 0.03: 0.34, 0.048: 1.018, 0.10: 1.836}
    for ratio, distance in table.items():
        found = margins(paper_case(), damping=ratio)
        signed = -distance if ratio < 0.02393 else distance
        assert float(found.nichols_disc_margin) == pytest.approx(signed, abs=6e-3), ratio
        assert bool(found.stable) == (ratio > 0.02393)


def test_global_minimum_and_slosh_minimum_are_told_apart_at_zero_damping():
    """T02: the global one is the rigid crossover (1.865 at 0.111 Hz), the slosh one 2.474 at 0.3208 Hz."""
    found = margins(paper_case(), damping=0.0)
    omega, value = _points(found.minima)
    assert omega[np.argmin(value)] / (2 * np.pi) == pytest.approx(0.111, abs=1e-3)
    slosh, _ = found.slosh_disc_margin(0)
    assert abs(float(slosh)) == pytest.approx(2.474, abs=1e-3)
    assert value[np.argmin(value)] == pytest.approx(1.865, abs=1e-3)


@pytest.mark.parametrize("attitude_gain", [0.08, 0.018])
def test_a_minimum_far_below_every_slosh_frequency_is_the_rigid_bodys(attitude_gain):
    """The air makes the loop's static gain finite; the masses follow there, their damping hardly moves the margin."""
    air = Aerodynamics(normal_force_slope=1.9e5, center_of_pressure=6.02, speed=300.0)
    case = paper_case(
        vehicle={"aerodynamics": air, "accelerometer_station": 2.6},
        tank={"slosh_mass": 300.0, "station": 1.66, "frequency": 1.9},
        more=(SloshMass(name="b", slosh_mass=225.0, station=10.0, frequency=2.06, damping=xi(0.03)),),
        attitude_gain=attitude_gain,
        accelerometer_gain=-0.003,
        delay=0.03,
        actuator=Actuator(frequency=35.0, damping=0.7),
    )
    found = margins(case, damping=0.03)
    low = [(w, v, mode) for w, v, mode in found.listed(found.minima) if w < 0.3 * 1.9]
    assert low
    for omega, value, mode in low:
        assert mode == "rigid body"
        L, _ = oracle_verdict.response(case, np.array([0.06, 0.06]), np.array([omega]))  # twice the damping
        assert oracle_verdict.distance(L, case.criteria)[0] == pytest.approx(
            value, abs=0.02
        )  # a slosh minimum would move by about 1
    for tank in (0, 1):
        assert found.slosh_disc_margin(tank)[1] > 0.3 * 1.9


def test_a_nearly_undamped_second_tank_is_not_missed():
    """T03: a 60 kg tank at 0.05 %: 20000 points on a log grid still give 0.487; the truth is near 0.11."""
    small = SloshMass(name="aux", slosh_mass=60.0, station=9.0, frequency=3.1, damping=xi(0.0005))
    case = paper_case(law=xi(0.048), more=(small,))
    c = oracle.numbers(case, [0.048, 0.0005])
    fine = 3.1 * (1 + np.linspace(-0.02, 0.02, 400_001))
    found, _ = oracle.disc_margin_minima(c, fine)
    least = min(v for _, v, _ in found)
    ours = margins(case)
    assert abs(float(ours.nichols_disc_margin)) <= least + 1e-9
    assert ours.groups[int(ours.mode(ours.minima)[0])] == "aux slosh"


def test_all_crossings_of_three_tanks_and_a_delay_are_listed_with_their_modes():
    """T09: a single number hides the rest."""
    more = (
        SloshMass(name="b", slosh_mass=800.0, station=9.5, frequency=2.6, damping=xi(0.004)),
        SloshMass(name="c", slosh_mass=600.0, station=8.0, frequency=3.2, damping=xi(0.004)),
    )
    case = paper_case(law=xi(0.004), more=more, delay=0.12)
    found = margins(case)
    gain, _ = oracle.crossings(oracle.numbers(case, 0.004), np.geomspace(0.05, 60, 400_001))
    ours = _points(found.gain_crossings)[0]
    assert len(ours) == len(gain) >= 5
    listed = found.listed(found.gain_crossings)
    assert len({name for _, _, name in listed}) >= 3
    assert len(_points(found.phase_crossings)[0]) >= 5


def test_several_crossings_at_three_percent_are_the_known_ones():
    """T09: xi = 3 %: gain margins 2.58 dB and 13.07 dB downwards, phase margin 61.8 deg, DM 0.34."""
    found = margins(paper_case(), damping=0.03)
    omega, ratio = _points(found.phase_crossings)
    db = 20 * np.log10(ratio)
    order = np.argsort(omega)
    np.testing.assert_allclose(np.sort(np.abs(db)), [2.58, 13.07], atol=5e-3)
    assert omega[order][np.argmin(np.abs(db[order]))] / (2 * np.pi) == pytest.approx(0.3413, abs=5e-5)
    _, pm = _points(found.gain_crossings)
    assert np.degrees(pm).min() == pytest.approx(61.8, abs=0.05)


def test_three_names_are_not_one_margin():
    """T10: at 4.8 % the ellipse margin is 1.018 while the modulus margin is 0.489."""
    w = np.geomspace(0.3, 5, 400_001)
    L = oracle.loop(oracle.numbers(paper_case(), 0.048), 1j * w)
    assert np.abs(1 + L).min() == pytest.approx(0.489, abs=1e-3)
    assert float(margins(paper_case(), damping=0.048).nichols_disc_margin) == pytest.approx(1.018, abs=1e-3)


def test_margins_agree_with_python_control_on_a_minimal_form():
    """T08: control gives nonsense on the six states; on the four-state form its margins are ours."""
    for ratio in (0.03, 0.048, 0.08):
        num, den = oracle.one_tank_polynomials(oracle.numbers(paper_case(), ratio))
        w = np.geomspace(0.2, 10, 20001)
        L = np.polyval(np.polymul(num, [0.14, 0.08]), 1j * w) / np.polyval(den, 1j * w)
        gm, pm, _, wpc, wgc, _ = control.stability_margins(control.frd(L, w, smooth=True), returnall=True)
        found = margins(paper_case(), damping=ratio)
        omega, ours = _points(found.phase_crossings)
        for g, x in zip(np.atleast_1d(gm), np.atleast_1d(wpc), strict=True):
            assert ours[np.argmin(np.abs(omega - x))] == pytest.approx(g, rel=1e-4)  # its spline over the grid
        omega, ours = _points(found.gain_crossings)
        for p, x in zip(np.atleast_1d(pm), np.atleast_1d(wgc), strict=True):
            assert np.degrees(ours[np.argmin(np.abs(omega - x))]) == pytest.approx(p, abs=1e-3)


def test_nyquist_count_agrees_with_python_control_on_a_minimal_form():
    for ratio, expected in ((0.01, 2), (0.03, 0), (0.048, 0)):
        num, den = oracle.one_tank_polynomials(oracle.numbers(paper_case(), ratio))
        loop = control.tf(np.polymul(num, [0.14, 0.08]), den)
        # its own grid and indentation: with a grid of ours it loses half a turn at the double pole at the origin
        count = control.nyquist_response(loop).count
        assert count == expected  # no open-loop poles to the right
        assert bool(margins(paper_case(), damping=ratio).stable) == (count == 0)


def test_a_not_a_number_never_passes():
    """T12: an unfilled slot is nan, and the signed margin of a loop is finite or says that it is unstable."""
    found = margins(paper_case(), damping=np.array([[0.01], [0.03], [0.048]]))
    assert np.all(np.isfinite(found.nichols_disc_margin))
    passed = np.isfinite(found.nichols_disc_margin) & (found.nichols_disc_margin >= 1.0)
    np.testing.assert_array_equal(passed, [False, False, True])
    for bad in (np.nan, np.inf, -0.01):
        with pytest.raises(ValueError, match="must be finite and >= 0"):
            margins(paper_case(), damping=bad)


def test_four_decibels_are_an_amplitude_ratio_in_the_loop():
    """T20: 4.304 dB and 170.9 ms bring the threshold loop to the critical point; a dB figure is an amplitude ratio."""
    found = margins(paper_case(gain=10 ** (4.304 / 20), delay=0.1709), damping=0.047358)
    assert abs(float(found.nichols_disc_margin)) < 1e-3


def test_poles_and_encirclements_agree_on_random_loops():
    rng = np.random.default_rng(32)
    for _ in range(60):
        case, damping = random_case(rng)
        found = margins(case, damping=damping)
        assert found.trusted
        assert found.witness == bool(found.stable)


def _equal_points(batch, index, alone):
    k = np.isfinite(batch.omega[index])
    j = np.isfinite(alone.omega)
    assert k.sum() == j.sum()
    # the frequency of a minimum is known to the root of the rounding of its value
    np.testing.assert_allclose(batch.omega[index][k], alone.omega[j], rtol=1e-6)
    np.testing.assert_allclose(batch.value[index][k], alone.value[j], rtol=1e-8, atol=1e-9)


def _equal(batch, index, alone):
    assert batch.stable[index] == alone.stable
    assert batch.growth[index] == pytest.approx(float(alone.growth), rel=1e-8)
    assert batch.nichols_disc_margin[index] == pytest.approx(float(alone.nichols_disc_margin), rel=1e-8)
    for name in ("minima", "gain_crossings", "phase_crossings"):
        _equal_points(getattr(batch, name), index, getattr(alone, name))


def test_margins_of_a_batch_of_vehicles_equal_a_loop():
    case = _varied(np.random.default_rng(33), (2, 3))
    batch = margins(case, damping=0.02)
    assert batch.stable.shape == (2, 3)
    for index in np.ndindex(2, 3):
        _equal(batch, index, margins(pick(case, index), damping=0.02))


def test_margins_of_a_damping_axis_equal_a_loop():
    levels = np.array([0.0, 0.01, 0.03, 0.048])
    batch = margins(paper_case(), damping=levels[:, None])
    for k, level in enumerate(levels):
        _equal(batch, k, margins(paper_case(), damping=float(level)))


def test_margins_of_vehicles_and_dampings_equal_a_double_loop():
    case = _varied(np.random.default_rng(34), (2,))
    levels = np.array([0.001, 0.01, 0.06])
    batch = margins(case, damping=levels[:, None, None] * np.ones(2))
    assert batch.stable.shape == (3, 2)
    for i, k in np.ndindex(3, 2):
        _equal(batch, (i, k), margins(pick(case, k), damping=float(levels[i])))


def test_slosh_amplitude_reads_the_damping_from_the_law():
    by_amplitude, by_ratio = margins(paper_case(PAPER_LAW), amplitude=0.3), margins(paper_case(), damping=0.03)
    assert float(by_amplitude.nichols_disc_margin) == pytest.approx(float(by_ratio.nichols_disc_margin), rel=1e-12)
