"""An actuator as a transfer function of any order, against the second implementation and against its other form."""

import control
import numpy as np
import pytest
from pydantic import ValidationError

import oracle_flexible as second
from cases import paper_case, real_case, xi
from held import hold_history
from sloshpy.autopilot import Actuator, Autopilot, Filter
from sloshpy.damping import PowerDamping
from sloshpy.dynamics import closed_loop_poles, frequency_response, open_loop
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.poles import closed_loop_eigenvalues, unstable_count
from sloshpy.files import case_schema, read_case, to_control, write_case
from sloshpy.report.inputs import input_rows
from sloshpy.simulation import simulate
from sloshpy.stability import margins
from sloshpy.stability.danger_zone import phase_lead
from sloshpy.stability.nichols import loop_zeros


def random_actuator(rng, w, excess=0):
    """A stable fraction of order 1 to 6 whose poles lie about w, by `excess` orders at least above its numerator."""
    order = int(rng.integers(max(1, excess), 7))
    poles = []
    while len(poles) < order:
        r = w * 10 ** rng.uniform(-0.3, 0.7)
        if order - len(poles) > 1 and rng.random() < 0.6:
            z = rng.uniform(0.2, 0.95)
            poles += [r * complex(-z, np.sqrt(1 - z * z)), r * complex(-z, -np.sqrt(1 - z * z))]
        else:
            poles.append(-r)
    count = int(rng.integers(0, order - excess + 1))
    zeros = [rng.choice([-1, 1]) * w * 10 ** rng.uniform(0.2, 1.2) for _ in range(count)]
    bottom, top = np.real(np.poly(poles)), np.real(np.poly(zeros)) if zeros else np.ones(1)
    top = top * rng.uniform(0.8, 1.0) * bottom[-1] / top[-1]
    return Actuator(numerator=tuple(map(float, top)), denominator=tuple(map(float, bottom)))


def given(case, actuator):
    return case.model_copy(update={"autopilot": case.autopilot.model_copy(update={"actuator": actuator})})


def fleet(seed, count, **parts):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        case, damping = real_case(rng, **parts)
        w = np.sqrt(
            case.autopilot.attitude_gain * case.vehicle.vectored_thrust * case.vehicle.cg / case.vehicle.inertia
        )
        yield rng, given(case, random_actuator(rng, 10 * w, 2 if case.vehicle.engine else 0)), damping


def as_fraction(actuator, scale=1.0):
    w, z = actuator.frequency, actuator.damping
    return Actuator(numerator=(scale * w**2,), denominator=(scale, scale * 2 * z * w, scale * w**2))


def test_loop_slosh_verdict_and_poles_of_200_vehicles_are_the_oracles():
    unstable = 0
    orders = set()
    for _, case, damping in fleet(411, 200):
        p, loop = second.second_order(case.vehicle, damping), open_loop(case, damping=damping)
        own = np.array([t.frequency for t in case.vehicle.tanks])
        w = np.concatenate([np.geomspace(0.05, 20, 15) * own[0], own])
        L, z, _ = second.solved(p, case.autopilot, 1j * w)
        found = frequency_response(loop, w)
        assert np.all(np.abs(found.loop - L) < 1e-10 * np.abs(L))
        assert np.all(np.abs(found.slosh - z) < 1e-10 * np.abs(z) + 1e-14 * np.abs(z).max(axis=0))
        growth = float(greatest_growth(loop))
        assert abs(growth) > 1e-9
        assert (growth < 0) == second.stable(p, case.autopilot) == (unstable_count(loop) == 0)
        values = closed_loop_eigenvalues(loop)
        assert np.sum(values[np.isfinite(values)].real > 0) == unstable_count(loop)
        assert second.backward_error(p, case.autopilot, values[np.isfinite(values)]).max() < 1e-9
        unstable += growth > 0
        orders.add(len(case.autopilot.actuator.denominator) - 1)
    assert 50 < unstable < 150
    assert orders == {1, 2, 3, 4, 5, 6}


def test_a_second_order_actuator_is_the_same_in_both_forms():
    rng = np.random.default_rng(412)
    for k in range(30):
        case, damping = real_case(rng, actuator=True)
        other = given(case, as_fraction(case.autopilot.actuator, scale=2.0**-9))  # scaled without rounding
        a, b = open_loop(case, damping), open_loop(other, damping)
        w = np.geomspace(0.05, 100, 50)
        np.testing.assert_allclose(frequency_response(a, w).loop, frequency_response(b, w).loop, rtol=1e-13)
        # the same poles in whatever order; the states of the two are others, so that eigenvalues near the origin agree
        # to the rounding of the greatest
        p, q = (x[np.isfinite(x)] for x in (closed_loop_eigenvalues(a), closed_loop_eigenvalues(b)))
        apart, rounding = np.abs(p[:, None] - q), 1e-15 * np.abs(p).max()
        assert len(p) == len(q) == len(set(apart.argmin(axis=1)))
        assert np.all(apart.min(axis=1) < 1e-13 * np.abs(p) + rounding)
        assert closed_loop_poles(a).kind == closed_loop_poles(b).kind
        assert unstable_count(a) == unstable_count(b)
        np.testing.assert_allclose(
            phase_lead(case.autopilot, w), phase_lead(other.autopilot, w), rtol=1e-13, atol=1e-13
        )
        if k < 6:
            one, two = margins(case, damping), margins(other, damping)
            assert one.nichols_disc_margin == pytest.approx(float(two.nichols_disc_margin), rel=1e-13)
            np.testing.assert_allclose(loop_zeros(a), loop_zeros(b), rtol=1e-13)
    case = paper_case(actuator=Actuator(frequency=30.0, damping=0.7), delay=0.05)
    one, two = (simulate(c, duration=20) for c in (case, given(case, as_fraction(case.autopilot.actuator))))
    # 1e-8 of the slosh: the rounding of two forms differs, and the step control passes it on
    assert np.abs(one.slosh - two.slosh).max() < 1e-10
    assert np.abs(one.tvc - two.tvc).max() < 1e-10


def test_the_poles_of_a_higher_order_actuator_are_called_actuator():
    actuator = Actuator(numerator=(9e6,), denominator=tuple(np.poly([-100.0, -300.0, -300.0])))
    poles = closed_loop_poles(open_loop(paper_case(xi(0.03), actuator=actuator)))
    assert poles.kind.count("actuator") >= 2
    assert set(poles.kind) == {"slosh", "rigid", "actuator"}


def test_the_lag_of_a_high_order_actuator_is_counted_beyond_half_a_turn():
    """Six first-order lags turn by 6 atan(w/w0), which a principal angle cannot hold."""
    poles = 3.0 * np.arange(1.0, 7.0)
    actuator = Actuator(numerator=(float(np.prod(poles)),), denominator=tuple(np.poly(-poles)))
    pilot = Autopilot(attitude_gain=0.08, rate_gain=0.14, actuator=actuator, delay=0.1)
    w = np.geomspace(0.1, 100, 30)
    expected = np.arctan2(0.14 * w, 0.08) - np.arctan(w[:, None] / poles).sum(axis=1) - 0.1 * w
    np.testing.assert_allclose(phase_lead(pilot, w), expected, rtol=1e-10, atol=1e-12)
    assert expected.min() < -np.pi
    # a zero on the right lags as a pole on the left; a notch of the filter returns what it takes
    allpass = Filter(numerator=(-1.0, 5.0), denominator=(1.0, 5.0))
    pilot = pilot.model_copy(update={"filter": (allpass,)})
    np.testing.assert_allclose(phase_lead(pilot, w), expected - 2 * np.arctan(w / 5.0), rtol=1e-10, atol=1e-12)


def test_time_histories_with_fractions_of_three_orders_agree_with_dop853():
    done = 0
    for rng, case, damping in fleet(413, 200, tanks=2, modes=1, engine=True, air=True, delay=False):
        p = second.second_order(case.vehicle, damping)
        if second.poles(p, case.autopilot).real.max() > 0.1:
            continue
        hold_history(rng, case, damping, duration=10)
        done += 1
        if done == 3:
            return
    raise AssertionError(done)


def test_an_actuator_that_passes_a_step_at_once_is_simulated_as_the_oracle_does():
    actuator = Actuator(numerator=(0.4, 20.0), denominator=(1.0, 20.0))  # lead-lag: a direct part of 0.4
    case = paper_case(PowerDamping(slope=0.2, exponent=1.0), actuator=actuator)
    run = simulate(case, duration=10.0, initial_slosh=0.2, step=2e-3)
    z, beta, phi = second.history(case.vehicle, case.autopilot, [lambda x: -0.15 * np.pi * x * abs(x)], [0.2], run.time)
    for ours, theirs in ((run.slosh, z), (run.tvc, beta), (run.attitude, phi)):
        assert np.abs(ours - theirs).max() < 1e-5 * np.abs(theirs).max()


def test_a_higher_order_actuator_goes_to_python_control_and_to_files(tmp_path):
    for k, (_, case, damping) in enumerate(fleet(414, 10, tanks=2, delay=False)):
        p, loop = second.second_order(case.vehicle, damping), open_loop(case, damping)
        w = np.geomspace(0.2, 20, 20)
        exact = second.solved(p, case.autopilot, 1j * w)[0]
        np.testing.assert_allclose(to_control(loop)(1j * w), exact, rtol=1e-7)
        closed = control.feedback(to_control(loop), 1).poles()
        assert closed.real.max() == pytest.approx(float(greatest_growth(loop)), rel=1e-6, abs=1e-7)
        back = read_case(write_case(case, tmp_path / f"{k}.toml"))
        assert back.autopilot.actuator == case.autopilot.actuator
        rows = {row.key for row in input_rows(back)}
        assert {"autopilot.actuator.numerator", "autopilot.actuator.denominator"} <= rows
    forms = case_schema()["properties"]["autopilot"]["properties"]["actuator"]["oneOf"]
    assert [sorted(form["required"]) for form in forms] == [["damping", "frequency"], ["denominator", "numerator"]]


@pytest.mark.parametrize("denominator", [(1.0, 0.0), (1.0, 0.0, 4.0), (1.0, 1.0, -1e-3), (1.0, 2.0, 3.0, 7.0)])
def test_an_actuator_with_a_pole_that_is_not_left_of_the_axis_is_refused(denominator):
    with pytest.raises(ValidationError, match="has a pole at"):
        Actuator(numerator=(1.0,), denominator=denominator)
    assert Actuator(numerator=(1.0,), denominator=(1.0, 2.0, 3.0, 5.9)).fraction[1].tolist() == [1.0, 2.0, 3.0, 5.9]
