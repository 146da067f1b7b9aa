"""The adaptive run against closed forms: matrix exponentials, delays by the method of steps, decay laws, energy."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

import oracle
from cases import paper_case, xi
from sloshpy.autopilot import Actuator, Filter
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.simulation import Noise, Pulse, Step, simulate, simulate_ensemble
from sloshpy.vehicle import SloshMass

SECOND = SloshMass(name="b", slosh_mass=400.0, station=4.0, frequency=2.6, damping=xi(0.02))
LIGHT = {"slosh_mass": 1e-6}  # moves nothing but itself
START = np.array([0.2, 0.0])  # m
FREE = {"attitude_gain": 1e-12, "rate_gain": 1e-12}


def flow(A, x, h, count):
    """States of x' = A x at count + 1 times h apart."""
    E, states = expm(A * h), [x]
    for _ in range(count):
        states.append(E @ states[-1])
    return np.array(states)


@pytest.mark.parametrize("filters", [(), (Filter(numerator=(1.0, 4.0), denominator=(0.1, 4.0)),)])
def test_a_linear_loop_is_its_matrix_exponential(filters):
    case = paper_case(more=(SECOND,), filter=filters, actuator=Actuator(frequency=20.0, damping=0.7))
    run = simulate(case, 40.0, np.array([0.2, -0.1]), damping=np.array([0.01, 0.02]), rtol=1e-9)
    A = oracle.first_order(oracle.numbers(case, np.array([0.01, 0.02])))
    x = np.zeros(len(A))
    x[2:4] = 0.2, -0.1
    exact = flow(A, x, run.step, len(run.time) - 1)
    assert np.abs(run.slosh - exact[:, 2:4]).max() < 1e-7 * 0.2
    assert np.abs(run.tvc - exact[:, -2]).max() < 1e-7 * np.abs(exact[:, -2]).max()
    assert np.abs(run.attitude - exact[:, 1]).max() < 1e-7 * np.abs(exact[:, 1]).max()


def delayed_chain(c, x, delay, bits, count, size=0.0):
    """States and engine of x' = A x + b (u(t - delay) + size), u = r x, by one exponential for each delay.

    On the k-th interval of length delay, X_k' = A X_k + b r X_(k-1): a chain that closes upon itself.
    """
    E, A, b = oracle._mechanics(c)
    n = len(b)
    moving = np.arange(n - len(c.m), n)  # the slosh velocities, last
    A[moving, moving] -= 2 * c.xi * c.w
    A, b = np.linalg.solve(E, A), np.linalg.solve(E, b)
    r = np.zeros(n)
    r[0], r[n - len(c.m) - 1] = c.gain * c.a0, c.gain * c.a1
    starts, states, engine = [x], [], []
    for k in range(count):
        chain = np.zeros(((k + 1) * n + 1,) * 2)  # the last state is 1, the constant disturbance
        for i in range(k + 1):
            rows = slice(i * n, (i + 1) * n)
            chain[rows, rows] = A
            chain[rows, -1] = b * size
            if i:
                chain[rows, (i - 1) * n : i * n] = np.outer(b, r)
        on = flow(chain, np.append(np.concatenate(starts), 1.0), delay / bits, bits)
        last = on[:, k * n : (k + 1) * n]
        states.append(last[:-1])
        engine.append((on[:-1, (k - 1) * n : k * n] @ r if k else np.zeros(bits)) + size)
        starts.append(last[-1])
    return np.concatenate(states), np.concatenate(engine)


@pytest.mark.parametrize("size", [0.0, 2e-3])
def test_a_delay_and_a_step_of_the_command_are_the_chain_of_exponentials(size):
    """The line lets nothing out before the delay; the jump at that moment and its echoes are on the right side."""
    delay, bits, count = 0.5, 10, 9
    case = paper_case(xi(0.01), delay=delay)
    run = simulate(
        case, delay * count, 0.3, damping=0.01, step=delay / bits, engine=Step(size=size) if size else None, rtol=1e-9
    )
    c = oracle.numbers(case, 0.01)
    x = np.zeros(5)
    x[1] = 0.3
    states, engine = delayed_chain(c, x, delay, bits, count, size)
    assert np.abs(run.slosh[:-1, 0] - states[:, 1]).max() < 1e-8 * 0.3
    assert np.abs(run.tvc[:-1] - engine).max() < 1e-7 * np.abs(engine).max()


def test_a_pulse_begins_and_ends_where_it_says():
    """Between output times and shorter than any step: its moment, size times duration, is what is left."""
    run = simulate(paper_case(xi(0.01)), 10.0, 0.0, engine=Pulse(size=0.1, duration=1e-4, start=3.00005), rtol=1e-9)
    assert np.all(run.slosh[run.time <= 3.0] == 0.0)
    c = oracle.numbers(paper_case(xi(0.01)), 0.01)
    A = oracle.first_order(c)
    kick = np.zeros(len(A))
    E, _, b = oracle._mechanics(c)
    kick[3:] = np.linalg.solve(E, b)[2:] * 0.1 * 1e-4
    after = run.time > 3.1
    exact = np.array([(expm(A * (t - 3.0001)) @ kick)[2] for t in run.time[after]])
    # the pulse is 1e-4 s long, the slosh takes 3 s
    assert np.abs(run.slosh[after, 0] - exact).max() < 1e-6 * np.abs(exact).max()


def test_linear_plus_quadratic_damping_decays_by_its_closed_form():
    """A(t) = A0 e^(-z t) / (1 + (alpha A0/zeta0)(1 - e^(-z t))), z = zeta0 w, to the first order in the damping."""
    zeta, alpha, w, A0 = 1e-3, 5e-3, 2.0, 0.5
    law = SumDamping(of=(ConstantDamping(ratio=zeta), PowerDamping(slope=alpha)))
    run = simulate(paper_case(law, tank=LIGHT, **FREE), 500.0, A0)
    z = run.slosh[:, 0]
    k = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1
    peaks = z[k] - (z[k + 1] - z[k - 1]) ** 2 / (8 * (z[k - 1] - 2 * z[k] + z[k + 1]))
    shift = 0.5 * (z[k - 1] - z[k + 1]) / (z[k - 1] - 2 * z[k] + z[k + 1]) * run.step
    gone = np.exp(-zeta * w * (run.time[k] + shift))
    exact = A0 * gone / (1 + alpha * A0 / zeta * (1 - gone))
    assert exact[-1] < 0.15 * A0
    assert np.abs(peaks / exact - 1).max() < 2e-5  # of order damping squared: (3.5e-3)^2 = 1.2e-5


@pytest.mark.parametrize("p", [0.5, 1.0, 2.0])
def test_energy_lost_is_the_work_of_the_damper(p):
    """T24: the force opposes the motion on either side of its kink."""
    law, w = PowerDamping(slope=0.1, exponent=p), 2.0
    run = simulate(paper_case(law, tank=LIGHT, **FREE), 30.0, 0.5, step=0.01)
    z = CubicSpline(run.time, run.slosh[:, 0])
    v = z(run.time, 1)
    energy = 0.5 * (v**2 + w**2 * z(run.time) ** 2)
    work = trapezoid(law.coefficient(w) * np.abs(v) ** (p + 2), run.time)
    inner = slice(5, -5)  # the spline's ends
    assert np.diff(energy[inner]).max() < 1e-7 * energy[0]
    assert energy[0] - energy[-1] == pytest.approx(work, rel=1e-5)


def test_a_tighter_tolerance_moves_the_limit_cycle_by_less_than_1e_5():
    case = paper_case(gain=10 ** (4.4 / 20), delay=0.17)
    one, two = (simulate(case, 200.0, 0.4, rtol=rtol) for rtol in (1e-6, 1e-8))
    assert one.slosh_envelope().settled
    assert one.slosh_envelope().amplitude == pytest.approx(two.slosh_envelope().amplitude, rel=1e-5)
    assert one.tvc_envelope.amplitude == pytest.approx(two.tvc_envelope.amplitude, rel=1e-5)


@pytest.mark.parametrize("p", [0.5, 1.0, 2.0])
def test_the_ensemble_kernel_agrees_to_1e_4_in_limit_cycle_amplitude(p):
    parts = {"more": (SECOND,), "delay": 0.06, "actuator": Actuator(frequency=20.0, damping=0.7)}
    case = paper_case(PowerDamping(slope=0.1, exponent=p), **parts)
    run, kernel = simulate(case, 400.0, START), simulate_ensemble(case, 400.0, START)
    for j in range(2):
        assert run.slosh_envelope(j).settled
        assert kernel.slosh_amplitude[j] == pytest.approx(run.slosh_envelope(j).amplitude, rel=1e-4)
    assert kernel.tvc_amplitude == pytest.approx(run.tvc_envelope.amplitude, rel=1e-4)


@dataclass(frozen=True)
class Broken:
    """A disturbance that is no number after 3 s."""

    jumps: tuple = ()

    def __call__(self, time):
        return np.where(np.asarray(time) > 3.0, np.nan, 0.0)


def test_a_failure_of_the_integrator_is_no_number():
    """T40."""
    run = simulate(paper_case(), 60.0, engine=Broken())
    assert "gave up" in run.stopped
    assert "at 3.0 s" in run.stopped
    assert run.time[-1] < 3.1
    assert np.all(np.isfinite(run.slosh))
    assert np.isnan(run.slosh_envelope().amplitude)
    short = TableDamping(amplitude=[0.0, 0.1], ratio=[0.0, 0.01])
    assert "beyond the damping data" in simulate(paper_case(short), 60.0, 0.3).stopped


def test_a_scalar_force_is_the_laws_acceleration():
    table = TableDamping(amplitude=[0.0, 0.1, 0.4], ratio=[0.002, 0.01, 0.02])
    both = SumDamping(of=(table, PowerDamping(slope=0.1, exponent=0.5), xi(0.01)))
    ends = PowerDamping(slope=0.2, exponent=0.5, largest_amplitude=0.3)
    for law in (xi(0.02), PowerDamping(slope=0.2), PowerDamping(slope=0.2, exponent=1.5), ends, table, both):
        v = np.linspace(-0.9, 0.9, 61)
        force = [law.force(2.0)(x) for x in v]
        np.testing.assert_allclose(force, law.acceleration(v, 2.0), rtol=1e-12, atol=1e-16)


def test_noise_one_time_at_a_time_is_its_sum_of_lines():
    noise = Noise(rms=1e-3, low=0.8, high=3.5, seed=5, lines=300)
    t = np.random.default_rng(3).uniform(0.0, 60.0, 300)

    one = noise.until(60.0)
    assert np.abs([one(x) for x in t] - noise(t)).max() < 5e-6 * 1e-3


def test_steps_land_on_the_kink_so_that_a_loose_tolerance_still_finds_the_limit_cycle():
    """Without landing 1e-4 of tolerance leaves 2.5e-4 of the amplitude."""
    loose, tight = (simulate(paper_case(), 300.0, 0.3, rtol=rtol).slosh_envelope().amplitude for rtol in (1e-4, 1e-10))
    assert loose == pytest.approx(tight, rel=1e-5)
