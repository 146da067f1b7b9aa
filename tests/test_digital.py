"""Digital autopilots: sampled sensors, filters in z, a held command; the sampled loop itself as the witness."""

import itertools
import json

import control
import numpy as np
import pytest
import scipy.integrate
import scipy.signal

import oracle_flexible as oracle
from cases import paper_case, real_case, xi
from sloshpy.assess import assess
from sloshpy.autopilot import Actuator, Autopilot, DigitalFilter, Filter, forward_transfer
from sloshpy.autopilot.transfer import forward_fraction
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.poles import closed_loop_eigenvalues
from sloshpy.dynamics.sampled import sampled_loop
from sloshpy.errors import OutsideValidity
from sloshpy.files import case_schema, from_control, read_case, to_control, write_case
from sloshpy.limit_cycle import limit_cycles, periodic_orbit, predict_limit_cycle
from sloshpy.simulation import simulate, simulate_ensemble
from sloshpy.stability import danger_zone, loop_margins, margins, required_damping, root_locus
from sloshpy.stability.danger_zone import phase_lead
from sloshpy.stability.folding import folding

LEAD = DigitalFilter(numerator=(1.8, -1.5), denominator=(1.0, -0.7))
NOTCH = DigitalFilter(numerator=(0.9, -1.6, 0.85), denominator=(1.0, -1.5, 0.65))


def with_autopilot(case, **parts):
    return case.model_copy(update={"autopilot": case.autopilot.model_copy(update=parts)})


def test_hold_and_filters_are_their_textbook_frequency_responses():
    T, w = 0.02, np.array([0.5, 3.0, 20.0, 100.0])
    pilot = Autopilot(attitude_gain=1.0, rate_gain=0.0, sample_time=T, digital_filter=(LEAD, NOTCH))
    hold = np.exp(-0.5j * w * T) * np.sinc(w * T / (2.0 * np.pi))
    wanted = hold * np.prod([scipy.signal.freqz(f.numerator, f.denominator, w * T)[1] for f in (LEAD, NOTCH)], axis=0)
    assert forward_transfer(pilot, 1j * w) == pytest.approx(wanted, rel=1e-12)


def test_numerator_denominator_and_their_derivatives_belong_together():
    pilot = Autopilot(attitude_gain=1.0, rate_gain=0.1, delay=0.03, sample_time=0.05, digital_filter=(LEAD, NOTCH))
    for s in np.array([0.0 + 1e-9j, 0.3 + 2.0j, -1.0 + 30.0j, 1e-5 + 1e-5j]):
        n, d, dn, dd = forward_fraction(pilot, np.array(s))
        assert n / d == pytest.approx(forward_transfer(pilot, np.array(s)), rel=1e-12)
        h = 1e-5
        after, before = (forward_fraction(pilot, np.array(s + x)) for x in (h, -h))
        assert dn == pytest.approx((after[0] - before[0]) / (2 * h), rel=1e-6)
        assert dd == pytest.approx((after[1] - before[1]) / (2 * h), rel=1e-6)


@pytest.mark.parametrize("delay", [0.0, 0.008, 0.02, 0.05])
def test_one_period_of_the_sampled_loop_is_an_integration_of_the_oracle_with_held_commands(delay):
    """The oracle integrates its own equations, samples, filters and holds; the poles must reproduce its sequence."""
    T = 0.02
    case = with_autopilot(
        paper_case(xi(0.02)),
        sample_time=T,
        delay=delay,
        digital_filter=(LEAD,),
        actuator=Actuator(frequency=25.0, damping=0.7),
        filter=(Filter(numerator=(1.0,), denominator=(0.02, 1.0)),),
    )
    p, pilot = oracle.second_order(case.vehicle, [0.02]), case.autopilot
    size, n = len(p.b0), len(p.b0)

    def slope(t, x, command):
        q, v, (angle, rate), analogue = x[:n], x[n : 2 * n], x[2 * n : 2 * n + 2], x[-1]
        jerk = 25.0**2 * (command - angle) - 2 * 0.7 * 25.0 * rate
        a = np.linalg.solve(p.E2, p.b0 * angle + p.b2 * jerk - p.E1 @ v - p.E0 @ q)
        y = pilot.attitude_gain * p.attitude @ q + pilot.rate_gain * p.rate @ v
        return np.concatenate([v, a, [rate, jerk], [(y - analogue) / 0.02]])

    x = np.zeros(2 * size + 3)
    x[2] = 0.1  # slosh
    waiting, sampled, state = [(-1.0, 0.0)], [], 0.0
    for k in range(120):
        y = x[-1]
        w = y - (-0.7) * state  # controllable form of LEAD, written out
        command = 1.8 * w - 1.5 * state
        state = w
        sampled.append(command)
        waiting.append((k * T + delay, command))
        ends = sorted({k * T, (k + 1) * T, *(t for t, _ in waiting if k * T < t < (k + 1) * T - 1e-12)})
        for a, b in itertools.pairwise(ends):
            held = [c for t, c in waiting if t <= a + 1e-12][-1]
            x = scipy.integrate.solve_ivp(slope, (a, b), x, args=(held,), rtol=1e-10, atol=1e-13).y[:, -1]
    exact = sampled_loop(open_loop(case))
    coefficients = np.poly(exact.poles)
    v = np.array(sampled)
    N = len(coefficients)
    residual = [coefficients @ v[k - N + 1 : k + 1][::-1] for k in range(2 * N, len(v))]
    assert np.max(np.abs(residual)) < 1e-7 * np.max(np.abs(v))


def test_the_sampled_loop_is_python_controls_discretisation():
    T, w = 0.05, np.geomspace(0.3, 55.0, 9)
    case = with_autopilot(paper_case(xi(0.03)), actuator=Actuator(frequency=30.0, damping=0.8))
    plant = control.c2d(to_control(open_loop(case)), T, "zoh")
    L = plant(np.exp(1j * w * T)) * scipy.signal.freqz(NOTCH.numerator, NOTCH.denominator, w * T)[1]
    digital = with_autopilot(case, sample_time=T, digital_filter=(NOTCH,))
    assert sampled_loop(open_loop(digital)).loop(w) == pytest.approx(L, rel=1e-7)


def test_margins_are_those_of_the_sampled_loop_far_below_half_the_rate():
    engine = Actuator(frequency=25.0, damping=0.7)  # it smooths what is held: with it little is folded
    case = with_autopilot(paper_case(xi(0.048)), sample_time=0.02, digital_filter=(LEAD,), actuator=engine)
    found = margins(case)
    exact = sampled_loop(found.source)
    w = np.linspace(1.9, 2.4, 200001)
    DM = np.hypot(20 * np.log10(np.abs(exact.loop(w))) / 6.0, np.angle(-exact.loop(w)) / (np.pi / 6))
    assert abs(float(found.slosh_disc_margin(0)[0])) == pytest.approx(np.min(DM), abs=1e-5)
    assert found.witness is not None
    assert found.trusted
    assert greatest_growth(found.source) == pytest.approx(exact.growth, abs=1e-5)


def test_half_a_period_of_hold_is_what_a_slow_computer_costs():
    """T15: a hold lags by half its period; left out, the margin would be that of the continuous loop."""
    continuous = paper_case(xi(0.048))
    digital = with_autopilot(continuous, sample_time=0.2)
    delayed = with_autopilot(continuous, delay=0.1)
    value = [float(required_damping(c).required) for c in (continuous, digital, delayed)]
    assert value[1] == pytest.approx(value[2], rel=0.02)  # the hold also takes a little gain
    assert abs(value[1] - value[0]) > 0.05 * value[0]


@pytest.mark.parametrize("seed", range(40))
def test_poles_and_sampled_loop_agree_on_random_real_vehicles(seed):
    rng = np.random.default_rng(4000 + seed)
    case, damping = real_case(rng, actuator=True)
    T = float(rng.uniform(0.005, 0.03))
    case = with_autopilot(case, sample_time=T, digital_filter=(LEAD,) if seed % 2 else ())
    loop = open_loop(case, damping)
    exact = sampled_loop(loop)
    s = np.log(exact.poles[np.abs(exact.poles) > 0.1]) / T
    near = s[np.abs(s.imag) < 0.2 * np.pi / T]
    slow = near[near.real > -0.1 * np.abs(near)]
    own = closed_loop_eigenvalues(loop)
    own = own[np.isfinite(own)]
    for pole in slow:  # what is folded moves them by its share of the loop alone
        assert np.min(np.abs(own - pole)) < 2e-3 * abs(pole) + 1e-4
    if abs(exact.growth) > 1e-3 and (greatest_growth(loop) < 0.0) != (exact.growth < 0.0):
        # a loop that is loud at half the sampling rate: no verdict is given, and the reason is folding
        found = loop_margins(loop, case.criteria)
        assert not found.trusted
        assert not folding(found).tolerated
        assert np.max(np.abs(s.imag[s.real > 0.0])) > 0.5 * np.pi / T


def test_a_bending_mode_folded_into_the_loop_is_found_out():
    """A mode at 0.98 of the sampling rate comes back at a fiftieth of it."""
    rng = np.random.default_rng(2)
    case, _ = real_case(rng, tanks=1, modes=1, engine=False, air=False, actuator=False)
    T, mode = 0.25, case.vehicle.flexible_modes[0]
    shaken = mode.model_copy(
        update={
            "frequency": 0.9 * 2 * np.pi / T,
            "damping": 0.002,
            "gimbal": mode.gimbal.model_copy(update={"deflection": 1.0, "slope": 0.0}),
            "gyro": mode.gyro.model_copy(update={"slope": 0.5}),
            "rate_gyro": None,
            "generalized_mass": 500.0,
        }
    )
    vehicle = case.vehicle.model_copy(update={"flexible_modes": (shaken,)})
    loud = with_autopilot(case.model_copy(update={"vehicle": vehicle}), sample_time=T, delay=0.0)
    found = assess(loud)
    assert found.verdict == "invalid"
    assert len(found.reasons) == 1
    assert found.reasons[0].startswith("FOLDING")
    assert "disc margin -" not in str(found)
    said = json.loads(found.to_json())
    assert said["stable"] is said["disc_margin"] is said["limit_cycles"] is None
    assert said["tanks"][0]["limit_cycle"] is said["tanks"][0]["required_damping"] is None


def test_a_quiet_digital_loop_says_what_folding_is_worth():
    found = assess(with_autopilot(paper_case(), sample_time=0.02))
    assert found.verdict == "pass"
    assert any("folds" in reason for reason in found.reasons)


def test_the_five_steps_end_at_a_neutral_sampled_loop():
    case = with_autopilot(paper_case(), sample_time=0.04, digital_filter=(LEAD,))
    cycle = predict_limit_cycle(case)
    threshold = float(cycle.required.required)
    degraded = case.model_copy(update={"autopilot": case.autopilot.degraded(cycle.gain, cycle.delay)})
    exact = sampled_loop(open_loop(degraded, threshold))
    assert exact.growth == pytest.approx(0.0, abs=2e-4)


def test_phase_lead_follows_hold_and_filters_continuously():
    T = 0.05
    for filters in ((LEAD,), (NOTCH,), (LEAD, NOTCH), (DigitalFilter(numerator=(0.5, 0.5), denominator=(1.0, 0.0)),)):
        pilot = Autopilot(attitude_gain=0.08, rate_gain=0.14, sample_time=T, digital_filter=filters, delay=0.03)
        w = np.linspace(0.01, 0.98 * np.pi / T, 4000)
        plain = np.unwrap(np.angle((0.08 + 0.14j * w) * forward_transfer(pilot, 1j * w)))
        plain -= 2 * np.pi * np.round(plain[0] / (2 * np.pi))
        assert phase_lead(pilot, w) == pytest.approx(plain, abs=1e-9)
    assert np.isfinite(danger_zone(with_autopilot(paper_case(), sample_time=T)).lead)


def test_a_digital_case_is_read_and_written(tmp_path):
    case = with_autopilot(paper_case(), sample_time=0.02, digital_filter=(LEAD, NOTCH))
    write_case(case, tmp_path / "digital.toml")
    assert read_case(tmp_path / "digital.toml") == case
    assert "digital_filter" in case_schema()["properties"]["autopilot"]["properties"]


@pytest.mark.parametrize(
    ("parts", "rule"),
    [
        ({"digital_filter": [{"numerator": [1.0], "denominator": [1.0]}]}, "is missing"),
        ({"sample_time": 0.02, "digital_filter": [{"numerator": [1.0], "denominator": [1.0, -1.2]}]}, "z = 1.2"),
        ({"sample_time": 0.02, "digital_filter": [{"numerator": [1.0], "denominator": [1.0, 1.0]}]}, "z = -1"),
        ({"sample_time": 0.02, "digital_filter": [{"numerator": [1.0], "denominator": [1.0, -2.0, 1.0]}]}, "2-fold"),
        ({"sample_time": 0.02, "digital_filter": [{"numerator": [1.0, 0.0], "denominator": [2.0]}]}, "more coeff"),
        ({"sample_time": 0.0}, "> 0"),
        (
            {"sample_time": 0.02, "digital_filter": 2 * [{"numerator": [1.0, 0.0], "denominator": [1.0, -1.0]}]},
            "integrates once more",
        ),
    ],
)
def test_impossible_digital_autopilots_are_refused(parts, rule):
    with pytest.raises(ValueError, match=rule):
        Autopilot.model_validate({"attitude_gain": 0.1, "rate_gain": 0.1} | parts)


def test_one_integrator_in_z_is_an_integrator():
    pilot = Autopilot(
        attitude_gain=1.0,
        rate_gain=0.0,
        sample_time=0.01,
        digital_filter=(DigitalFilter(numerator=(0.01, 0.0), denominator=(1.0, -1.0)),),
    )
    s = np.array(0.01j)
    assert forward_transfer(pilot, s) == pytest.approx(1.0 / s, rel=1e-3)


def test_a_filter_designed_in_python_control_becomes_a_digital_one():
    found = from_control(control.TransferFunction([1.8, -1.5], [1.0, -0.7], 0.02))
    assert found == LEAD
    digital = with_autopilot(paper_case(xi(0.02)), sample_time=0.02)
    with pytest.raises(OutsideValidity, match="digital"):
        to_control(open_loop(digital))


def test_verbs_that_know_no_sampler_refuse_one():
    digital = with_autopilot(paper_case(), sample_time=0.02)
    for verb in (periodic_orbit, simulate_ensemble):
        with pytest.raises(OutsideValidity, match="sampler"):
            verb(digital)


def test_the_root_locus_passes_the_sampled_poles():
    case = with_autopilot(paper_case(), sample_time=0.02)
    exact = sampled_loop(open_loop(case, 0.02))
    s = np.log(exact.poles[np.abs(exact.poles) > 0.5]) / 0.02
    closed = root_locus(case, 0.02).closed
    for pole in s[(s.imag > 0.0) & (s.imag < 5.0)]:
        assert np.min(np.abs(closed - pole)) < 1e-4


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.06])
def test_a_simulation_follows_the_sampled_loop_from_sample_to_sample(delay):
    T = 0.04
    engine = Actuator(frequency=25.0, damping=0.7)
    case = with_autopilot(
        paper_case(xi(0.02)), sample_time=T, delay=delay, digital_filter=(LEAD, NOTCH), actuator=engine
    )
    run = simulate(case, 12.0, 0.1, step=T, rtol=1e-10)
    poles = sampled_loop(open_loop(case)).poles
    coefficients = np.poly(poles)
    N = len(coefficients)
    for signal in (run.slosh[:, 0], run.attitude):
        residual = [coefficients @ signal[k - N + 1 : k + 1][::-1] for k in range(2 * N, len(signal))]
        assert np.max(np.abs(residual)) < 1e-7 * np.max(np.abs(signal))


def test_the_limit_cycle_of_a_digital_loop_is_the_simulated_one():
    engine = Actuator(frequency=25.0, damping=0.7)
    case = with_autopilot(paper_case(), sample_time=0.04, delay=0.013, digital_filter=(LEAD,), actuator=engine)
    (cycle,) = limit_cycles(case)
    run = simulate(case, 200.0, 0.2)
    assert run.slosh_envelope().amplitude == pytest.approx(cycle.slosh_amplitude["LOX"], rel=1e-3)
    assert run.tvc_envelope.amplitude == pytest.approx(cycle.tvc_amplitude, rel=5e-3)
