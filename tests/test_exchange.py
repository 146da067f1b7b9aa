"""Loops go to python-control and filters come back without a change of response."""

import control
import numpy as np
import pytest

import oracle
from cases import paper_case, random_case, xi
from sloshpy.autopilot import Actuator, Filter
from sloshpy.dynamics import frequency_response, open_loop
from sloshpy.files import from_control, response_to_control, to_control

OMEGA = np.geomspace(0.2, 20.0, 60)


@pytest.mark.parametrize("seed", range(5))
def test_state_space_of_python_control_has_the_oracles_loop(seed):
    case, _ = random_case(np.random.default_rng(seed), delay=False)
    damping = np.full(len(case.vehicle.tanks), 0.02)
    system = to_control(open_loop(case, damping))
    exact = oracle.loop(oracle.numbers(case, damping), 1j * OMEGA)
    np.testing.assert_allclose(system(1j * OMEGA), exact, rtol=1e-8)


def test_closing_the_loop_in_python_control_gives_the_closed_loop_poles():
    loop = open_loop(paper_case(actuator=Actuator(frequency=30.0, damping=0.7)), 0.01)
    closed = control.feedback(to_control(loop), 1)
    assert np.max(closed.poles().real) == pytest.approx(
        oracle.poles(
            oracle.numbers(paper_case(actuator=Actuator(frequency=30.0, damping=0.7)), np.array([0.01]))
        ).real.max(),
        abs=1e-8,
    )


def test_delay_is_exact_in_frequency_response_data_and_near_in_state_space():
    case = paper_case(xi(0.03), delay=0.17)
    response = frequency_response(open_loop(case), OMEGA)
    exact = oracle.loop(oracle.numbers(case, np.array([0.03])), 1j * OMEGA)
    data = response_to_control(response)
    np.testing.assert_allclose(np.squeeze(data.frdata), exact, rtol=1e-10)
    np.testing.assert_allclose(to_control(open_loop(case))(1j * OMEGA), exact, rtol=1e-6)


def test_a_filter_designed_in_python_control_acts_the_same_in_the_loop():
    designed = control.tf([1.0, 0.2, 9.0], [1.0, 3.0, 9.0])
    taken = from_control(designed)
    assert taken == Filter(numerator=(1.0, 0.2, 9.0), denominator=(1.0, 3.0, 9.0))
    plain = frequency_response(open_loop(paper_case(xi(0.03))), OMEGA).loop
    filtered = frequency_response(open_loop(paper_case(xi(0.03), filter=(taken,))), OMEGA).loop
    np.testing.assert_allclose(filtered / plain, designed(1j * OMEGA), rtol=1e-12)


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (control.ss(-np.eye(2), np.eye(2), np.eye(2), 0), "2 inputs"),
        (control.tf([1.0], np.poly(-np.arange(1.0, 13.0))), "order 12"),
        (3.0, "float"),
    ],
)
def test_what_is_no_filter_is_refused(system, message):
    with pytest.raises(ValueError, match=message):
        from_control(system)


def test_a_batch_is_refused():
    with pytest.raises(ValueError, match="batch"):
        to_control(open_loop(paper_case(), np.array([[0.01], [0.02]])))
