"""Time histories against DOP853, the method of steps, closed forms and conservation."""

import numpy as np
import pytest

import oracle
from cases import PAPER_LAW, paper_case, xi
from sloshpy.autopilot import Actuator
from sloshpy.damping import PowerDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.simulation import simulate
from sloshpy.vehicle import SloshMass

B = 3 * np.pi * 0.1 / 4


def square(b):
    return lambda v: -b * v * abs(v)


def test_nonlinear_history_agrees_with_dop853():
    run = simulate(paper_case(), duration=40.0, initial_slosh=0.3, step=0.01)
    z, beta, phi = oracle.history(oracle.numbers(paper_case(), 0.0), [square(B)], 0.3, run.time)
    # 1e-5 of the amplitude: RK4 at w h = 0.02 loses 40 (w h)^5/120 per radian
    assert np.abs(run.slosh - z).max() < 1e-5 * 0.3
    assert np.abs(run.tvc - beta).max() < 1e-5 * np.abs(beta).max()
    assert np.abs(run.attitude - phi).max() < 1e-5 * np.abs(phi).max()


def test_two_tanks_with_their_own_laws_and_an_actuator_agree_with_dop853():
    more = (SloshMass(name="b", slosh_mass=400.0, station=4.0, frequency=2.6, damping=xi(0.02)),)
    case = paper_case(more=more, actuator=Actuator(frequency=20.0, damping=0.7))
    run = simulate(case, duration=25.0, initial_slosh=np.array([0.2, -0.1]), step=0.005)
    forces = [square(B), lambda v: -2 * 0.02 * 2.6 * v]
    z, beta, _ = oracle.history(oracle.numbers(case, 0.0), forces, [0.2, -0.1], run.time)
    assert np.abs(run.slosh - z).max() < 1e-5 * 0.2
    assert np.abs(run.tvc - beta).max() < 1e-5 * np.abs(beta).max()


def test_delay_line_agrees_with_the_method_of_steps():
    case = paper_case(delay=0.17, gain=10 ** (4.4 / 20))
    run = simulate(case, duration=20.0, initial_slosh=0.3, step=0.01)
    z, beta, _ = oracle.history(oracle.numbers(case, 0.0), [square(B)], 0.3, run.time)
    # the first delayed command meets a kink at t = tau, on a step
    assert np.abs(run.slosh - z).max() < 1e-5 * 0.3
    assert np.abs(run.tvc - beta).max() < 2e-5 * np.abs(beta).max()


def test_delay_before_an_actuator_agrees_with_the_method_of_steps():
    case = paper_case(delay=0.11, actuator=Actuator(frequency=15.0, damping=0.7))
    run = simulate(case, duration=15.0, initial_slosh=0.3, step=0.003)
    z, beta, _ = oracle.history(oracle.numbers(case, 0.0), [square(B)], 0.3, run.time)
    assert np.abs(run.slosh - z).max() < 1e-5 * 0.3
    assert np.abs(run.tvc - beta).max() < 2e-5 * np.abs(beta).max()


def test_free_undamped_slosh_is_a_cosine_with_its_closed_form_frequency():
    """T39: with a vanishing gain the slosh mode is the plant's; numerical damping below 1e-3 of 1 %."""
    case = paper_case(law=xi(0.0), attitude_gain=1e-12, rate_gain=1e-12)
    run = simulate(case, duration=60.0, initial_slosh=0.1)
    _, den = oracle.one_tank_polynomials(oracle.numbers(case, 0.0))
    w = np.sqrt(den[2] / den[0])
    # from rest with phi free the coupled start z0 stays on the slosh mode apart from a rigid tilt that z feels not
    z = run.slosh[:, 0]
    np.testing.assert_allclose(z, 0.1 * np.cos(w * run.time), atol=0.1 * 1e-3)
    last = z[run.time > 50]
    assert -np.log(np.abs(last).max() / 0.1) / (w * 55) < 1e-5


def test_linear_damping_decays_as_its_pole():
    case = paper_case(attitude_gain=1e-12, rate_gain=1e-12)
    run = simulate(case, duration=30.0, initial_slosh=0.1, damping=0.02)
    _, den = oracle.one_tank_polynomials(oracle.numbers(case, 0.02))
    p = np.roots(den[:3])[0]
    z = 0.1 * (np.exp(p * run.time) * (1 - p.real / (1j * abs(p.imag)) * np.sign(p.imag))).real
    np.testing.assert_allclose(run.slosh[:, 0], z, atol=1e-5)


def test_halving_the_step_moves_the_amplitude_by_less_than_a_thousandth():
    case = paper_case(gain=10 ** (4.4 / 20), delay=0.17)
    one, two = (simulate(case, duration=260.0, initial_slosh=0.4, step=h).slosh_envelope() for h in (0.04, 0.02))
    assert one.settled
    assert two.settled
    assert one.amplitude == pytest.approx(two.amplitude, rel=1e-3)


def test_a_short_run_is_called_unconverged_and_gives_no_number():
    """T27: the last 10 s show 0.295 m at 30 s and 0.434 m at 60 s."""
    case = paper_case(gain=10 ** (4.4 / 20), delay=0.17)
    for duration in (10.0, 30.0, 60.0):
        found = simulate(case, duration=duration, initial_slosh=0.1).slosh_envelope()
        assert not found.settled
        assert np.isnan(found.amplitude)
        assert "unconverged" in found.reason


def test_deflection_limit_is_respected_and_changes_the_amplitude():
    """T31: 2 mrad limit, 0.320 m in place of 0.447 m."""
    free = paper_case(gain=10 ** (4.4 / 20), delay=0.17, actuator=Actuator(frequency=300.0, damping=1.0))
    fast = Actuator(frequency=300.0, damping=1.0, deflection_limit=2e-3)
    held = paper_case(gain=10 ** (4.4 / 20), delay=0.17, actuator=fast)
    # 300 rad/s adds 7 ms of lag to the 170 ms; the printed figures have none
    a = simulate(free, duration=200.0, initial_slosh=0.4)
    b = simulate(held, duration=200.0, initial_slosh=0.3)
    assert np.abs(b.tvc).max() <= 2e-3 * (1 + 1e-9)
    assert np.abs(a.tvc).max() > 4e-3
    assert b.slosh_envelope().amplitude == pytest.approx(0.320, rel=0.02)
    assert b.slosh_envelope().amplitude < a.slosh_envelope().amplitude


def test_rate_limit_is_respected():
    limit = 2e-3
    case = paper_case(actuator=Actuator(frequency=20.0, damping=0.7, rate_limit=limit))
    run = simulate(case, duration=40.0, initial_slosh=0.5, step=0.005)
    rate = np.abs(np.diff(run.tvc) / np.diff(run.time))
    # two samples of the angle, each good to the integrator's 1e-6 of its greatest
    assert rate.max() <= limit + 2e-6 * np.abs(run.tvc).max() / run.step
    free = simulate(paper_case(actuator=Actuator(frequency=20.0, damping=0.7)), duration=40.0, initial_slosh=0.5)
    assert np.abs(np.diff(free.tvc) / np.diff(free.time)).max() > 2 * limit


def test_unlimited_limits_change_nothing():
    base = Actuator(frequency=20.0, damping=0.7)
    wide = Actuator(frequency=20.0, damping=0.7, deflection_limit=1.0, rate_limit=10.0)
    one, two = (simulate(paper_case(actuator=a), duration=20.0, step=0.01) for a in (base, wide))
    np.testing.assert_allclose(one.tvc, two.tvc, atol=1e-12 * np.abs(one.tvc).max(), rtol=0.0)


def test_a_table_that_starts_above_zero_has_no_force():
    late = TableDamping(amplitude=[0.1, 0.9], ratio=[0.01, 0.09])
    with pytest.raises(OutsideValidity):
        simulate(paper_case(late), duration=5.0)


def test_a_run_that_leaves_its_table_stops_and_says_so():
    short = TableDamping(amplitude=[0.0, 0.1], ratio=[0.0, 0.01])
    run = simulate(paper_case(short, gain=10 ** (4.4 / 20), delay=0.17), duration=100.0, initial_slosh=0.08)
    assert run.stopped
    assert not run.slosh_envelope().settled


def test_a_run_that_leaves_a_formula_stops_where_the_same_formula_without_an_end_passes_it():
    ends = PowerDamping(slope=0.1, largest_amplitude=0.3)  # the degraded loop cycles at 0.44 m
    degraded = {"gain": 10 ** (4.4 / 20), "delay": 0.17}
    run = simulate(paper_case(ends, **degraded), duration=300.0, initial_slosh=0.05)
    free = simulate(paper_case(**degraded), duration=300.0, initial_slosh=0.05)
    assert run.stopped.startswith("beyond the damping data at ")
    assert not run.slosh_envelope().settled
    k = len(run.time)
    # where the last step is tried beyond the end it is cut, which moves a run by the error of a step
    np.testing.assert_allclose(run.slosh, free.slosh[:k], atol=1e-6)
    speed = np.abs(np.gradient(free.slosh[:, 0], free.time))
    assert np.max(speed[: k - 2]) < 2.0 * 0.3
    assert np.max(speed[: k + 2]) > 0.99 * 2.0 * 0.3
    within = simulate(paper_case(PowerDamping(slope=0.1, largest_amplitude=0.6), **degraded), 300.0, 0.05)
    np.testing.assert_allclose(within.slosh, free.slosh, atol=1e-6)


def test_power_law_in_time_equals_its_table_in_time():
    a = np.linspace(0, 0.9, 46)
    table = TableDamping(amplitude=a, ratio=0.1 * a)
    one, two = (simulate(paper_case(law), duration=30.0, initial_slosh=0.3) for law in (PAPER_LAW, table))
    np.testing.assert_allclose(one.slosh, two.slosh, atol=1e-5)


def test_ring_baffle_law_holds_in_time():
    law = PowerDamping(slope=0.05, exponent=0.5)
    run = simulate(paper_case(law), duration=15.0, initial_slosh=0.3, step=0.01)
    c = law.coefficient(2.0)
    z, _, _ = oracle.history(
        oracle.numbers(paper_case(), 0.0), [lambda v: -c * abs(v) ** 0.5 * v], 0.3, run.time, rtol=1e-9
    )
    assert np.abs(run.slosh - z).max() < 1e-5


def test_a_delay_that_asks_for_more_steps_than_a_run_can_take_is_refused():
    with pytest.raises(ValueError, match="which the delay asks for"):
        simulate(paper_case(delay=1e-6), 60.0)
