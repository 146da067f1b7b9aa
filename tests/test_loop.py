"""The loop transfer against the oracle, a closed form, another library and itself in batches."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from cases import paper_case, random_case, xi
from sloshpy.autopilot import Autopilot
from sloshpy.case import Case
from sloshpy.dynamics import frequency_response, open_loop
from sloshpy.stability import nichols_disc_margin
from sloshpy.vehicle import SloshMass, Vehicle


def test_loop_and_slosh_response_agree_with_a_full_solve_on_300_random_cases():
    rng = np.random.default_rng(1)
    for _ in range(300):
        case, damping = random_case(rng)
        c = oracle.numbers(case, damping)
        w = np.concatenate([np.geomspace(0.05, 10, 60) * c.w.mean(), c.w, c.w * (1 + damping), c.w * 1.01])
        L, z = oracle.solved(c, 1j * w)
        ours = frequency_response(open_loop(case, damping=damping), w)
        # 1e-10: the condition of the solve times 1e-16. Far below slosh k3 phi and Z'' cancel in z_j, so the grid
        # starts at a twentieth of the slosh frequency; the floor is the size of the terms that cancel at a zero.
        np.testing.assert_allclose(ours.loop, L, rtol=1e-10, atol=1e-13 * np.abs(L).max())
        np.testing.assert_allclose(ours.slosh, z, rtol=1e-10, atol=1e-13 * np.abs(z).max())


def test_the_two_routes_of_the_oracle_agree():
    rng = np.random.default_rng(2)
    for _ in range(50):
        case, damping = random_case(rng)
        c = oracle.numbers(case, damping)
        s = 1j * np.geomspace(0.05, 30, 50) + rng.uniform(-0.1, 0.1)
        np.testing.assert_allclose(oracle.loop(c, s), oracle.solved(c, s)[0], rtol=1e-9)


def test_loop_of_one_tank_is_the_pd_law_times_eq_21():
    for ratio in (0.0, 0.01, 0.048):
        case = paper_case(vehicle={"vectored_thrust": 6e5, "drag": 5e4})
        c = oracle.numbers(case, ratio)
        num, den = oracle.one_tank_polynomials(c)
        w = np.geomspace(0.05, 20, 200)
        expected = (0.08 + 0.14j * w) * np.polyval(num, 1j * w) / np.polyval(den, 1j * w)
        ours = frequency_response(open_loop(case, damping=ratio), w).loop
        np.testing.assert_allclose(ours, expected, rtol=1e-11)


def test_delay_is_exact_and_turns_the_phase_by_omega_tau():
    w = np.array([0.3, 2.0, 40.0])
    L0 = frequency_response(open_loop(paper_case(), damping=0.03), w).loop
    L1 = frequency_response(open_loop(paper_case(delay=0.17), damping=0.03), w).loop
    np.testing.assert_allclose(L1 / L0, np.exp(-0.17j * w), rtol=1e-13)


def test_disc_margin_of_eq_24_needs_no_modulus_convention():
    """T05: floored modulus; degrees or a truncated remainder give 0.154 or 9.57 in place of 1.018."""
    rng = np.random.default_rng(3)
    L = np.exp(rng.uniform(-2, 2, 500) + 1j * rng.uniform(-np.pi, np.pi, 500))
    np.testing.assert_allclose(
        nichols_disc_margin(L, 10**0.3, np.pi / 6), oracle.disc_margin(L), rtol=1e-10, atol=1e-12
    )
    for phase, expected in (
        (np.pi - 0.1, 0.1),
        (-np.pi + 0.1, 0.1),
        (-1.0, np.pi - 1),
        (1.0, np.pi - 1),
        (-1e-12, np.pi),
    ):
        assert nichols_disc_margin(np.exp(1j * phase), 10**0.3, np.pi / 6) == pytest.approx(
            expected * 6 / np.pi, rel=1e-9
        )


def test_every_odd_multiple_of_180_deg_is_a_critical_point():
    """T06: phase -540 deg is as near as -180 deg."""
    w = np.geomspace(0.5, 60, 4000)
    case = paper_case(delay=0.4, gain=30.0)
    L = frequency_response(open_loop(case, damping=0.048), w)
    unwrapped = np.degrees(np.unwrap(np.angle(L.loop)))
    assert unwrapped.min() < -540
    at = np.argmin(np.abs(unwrapped + 540))
    only_gain = abs(L.gain_db[at]) / 6.0
    assert nichols_disc_margin(L.loop[at], 10**0.3, np.pi / 6) == pytest.approx(only_gain, abs=0.1)


def test_gain_and_phase_are_those_of_the_complex_loop():
    w = np.geomspace(0.2, 20, 500)
    response = frequency_response(open_loop(paper_case(delay=0.1), damping=0.02), w)
    back = 10 ** (response.gain_db / 20) * np.exp(1j * np.radians(response.phase_deg))
    np.testing.assert_allclose(back, response.loop, rtol=1e-10)
    assert np.abs(np.diff(response.phase_deg)).max() < 60.0  # one branch, no jump of 360
    np.testing.assert_allclose(response.f_hz, w / (2 * np.pi))


def test_positive_loop_means_negative_feedback_at_low_frequency():
    """Far below the slosh L is the double integrator -c2 a0 / w^2: real and negative, that is -180 deg."""
    w = np.array([1e-3])
    L = frequency_response(open_loop(paper_case(), damping=0.03), w).loop[0]
    # at low frequency the slosh mass follows quasi-statically; its moment shifts the gain by k3 k4 m/(I w^2) ~ 8 %
    num, den = oracle.one_tank_polynomials(oracle.numbers(paper_case(), 0.03))
    assert pytest.approx(-0.08 * num[-1] / den[2] / w[0] ** 2, rel=5e-3) == L


def test_slosh_response_agrees_with_python_control():
    case = paper_case()
    c = oracle.numbers(case, 0.03)
    num, den = oracle.one_tank_polynomials(c)
    plant = control.tf(num, den) * control.tf([0.14, 0.08], [1])
    w = np.geomspace(0.1, 20, 60)
    np.testing.assert_allclose(
        frequency_response(open_loop(case, damping=0.03), w).loop,
        control.frequency_response(plant, w).complex,
        rtol=1e-9,
    )


def _varied(rng, shape):
    def draw(value):
        return value * (1 + 0.05 * rng.uniform(-1, 1, shape))

    return Case(
        name="batch",
        vehicle=Vehicle(
            mass=draw(1.6e4),
            inertia=draw(9e5),
            cg=draw(6.0),
            thrust=draw(9e5),
            vectored_thrust=draw(7e5),
            tanks=tuple(
                SloshMass(name=n, slosh_mass=draw(m), station=draw(x), frequency=draw(w), damping=xi(0.03))
                for n, m, x, w in (("a", 1e3, 9.0, 2.0), ("b", 400.0, 3.0, 2.6))
            ),
        ),
        autopilot=Autopilot(
            attitude_gain=draw(0.08),
            rate_gain=draw(0.14),
            gain=draw(1.0),
            delay=np.abs(draw(0.05)) * rng.integers(0, 2, shape),
        ),
    )


def pick(case, index):
    """One vehicle of a batch case."""

    def one(value):
        return float(value[index]) if isinstance(value, np.ndarray) else value

    vehicle, pilot = case.vehicle, case.autopilot
    names = ("mass", "inertia", "cg", "thrust", "vectored_thrust", "drag")
    return Case(
        name=case.name,
        vehicle=Vehicle(
            **{n: one(getattr(vehicle, n)) for n in names},
            tanks=tuple(
                SloshMass(
                    name=t.name,
                    slosh_mass=one(t.slosh_mass),
                    station=one(t.station),
                    frequency=one(t.frequency),
                    damping=t.damping,
                )
                for t in vehicle.tanks
            ),
        ),
        autopilot=Autopilot(
            **{n: one(getattr(pilot, n)) for n in ("attitude_gain", "rate_gain", "gain", "delay")},
            actuator=pilot.actuator,
            filter=pilot.filter,
        ),
    )


def test_frequency_response_of_a_batch_equals_a_loop_over_vehicles():
    case = _varied(np.random.default_rng(4), (3, 4))
    w = np.geomspace(0.3, 10, 25)
    batch = frequency_response(open_loop(case, damping=0.02), w)
    assert batch.loop.shape == (3, 4, 25)
    for index in np.ndindex(3, 4):
        one = frequency_response(open_loop(pick(case, index), damping=0.02), w)
        np.testing.assert_allclose(batch.loop[index], one.loop, rtol=1e-12)
        np.testing.assert_allclose(batch.slosh[index], one.slosh, rtol=1e-12)


def test_frequency_response_of_a_damping_axis_equals_a_loop_over_dampings():
    levels = np.array([0.0, 0.001, 0.03])
    w = np.geomspace(0.3, 10, 25)
    batch = frequency_response(open_loop(paper_case(), damping=levels[:, None]), w)
    for k, level in enumerate(levels):
        np.testing.assert_allclose(
            batch.loop[k], frequency_response(open_loop(paper_case(), damping=float(level)), w).loop, rtol=1e-12
        )


def test_frequency_response_of_vehicles_and_dampings_equals_a_double_loop():
    case = _varied(np.random.default_rng(5), (3,))
    levels = np.array([[0.001, 0.002], [0.05, 0.01]])
    w = np.geomspace(0.3, 10, 25)
    batch = frequency_response(open_loop(case, damping=levels[:, None, :]), w)
    assert batch.loop.shape == (2, 3, 25)
    for i, k in np.ndindex(2, 3):
        one = frequency_response(open_loop(pick(case, k), damping=levels[i]), w)
        np.testing.assert_allclose(batch.loop[i, k], one.loop, rtol=1e-12)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.floats(0.2, 20), st.floats(1e-4, 0.1), st.floats(0.1, 10), st.floats(0, 0.5))
def test_gain_and_delay_multiply_the_loop(w, ratio, gain, delay):
    base = frequency_response(open_loop(paper_case(), damping=ratio), np.array([w])).loop[0]
    other = paper_case().model_copy(update={"autopilot": paper_case().autopilot.degraded(gain, delay)})
    assert frequency_response(open_loop(other, damping=ratio), np.array([w])).loop[0] == pytest.approx(
        base * gain * np.exp(-1j * w * delay), rel=1e-12
    )
