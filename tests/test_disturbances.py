"""Disturbances in time and the rms of noise: closed forms, superposition, and simulation against frequency domain."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

import oracle
from cases import paper_case, xi
from sloshpy.autopilot import Actuator
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.simulation import Noise, OneMinusCosine, Pulse, Samples, Step, forced_response, simulate
from sloshpy.simulation.forced import stochastic_ratio
from sloshpy.vehicle import Aerodynamics

AIR = {"aerodynamics": Aerodynamics(normal_force_slope=2e4, center_of_pressure=7.0, speed=400.0)}
BAND = (1.0, 4.0)  # rad/s


def test_each_signal_has_its_shape():
    t = np.array([-1.0, 0.5, 1.0, 2.0, 3.0, 4.0])
    assert Step(size=2.0, start=1.0)(t).tolist() == [0, 0, 2, 2, 2, 2]
    assert Pulse(size=2.0, start=1.0, duration=2.0)(t).tolist() == [0, 0, 2, 2, 0, 0]
    gust = OneMinusCosine(size=9.0, start=1.0, duration=2.0)
    assert gust(np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5])) == pytest.approx([0, 4.5, 9, 4.5, 0, 0])
    table = Samples(time=np.array([0.0, 2.0]), value=np.array([1.0, 3.0]))
    assert table(t).tolist() == [0, 1.5, 2, 3, 0, 0]
    with pytest.raises(ValueError, match="increase"):
        Samples(time=np.array([0.0, 0.0]), value=np.array([1.0, 3.0]))


def test_noise_has_its_rms_its_band_and_a_gaussian_shape():
    noise = Noise(rms=0.3, low=1.0, high=4.0, seed=3, lines=600)
    n = 2**14
    t = np.arange(n) * noise.period / n
    x = noise(t)
    assert np.sqrt(np.mean(x**2)) == pytest.approx(0.3, rel=1e-4)
    omega = 2 * np.pi * np.fft.rfftfreq(n, t[1])
    power = np.abs(np.fft.rfft(x)) ** 2
    # a line in the middle of each cell leaks half a bin
    assert power[(omega > 0.99) & (omega < 4.01)].sum() > 0.999 * power.sum()
    assert np.mean(x**4) / np.mean(x**2) ** 2 == pytest.approx(3.0, abs=0.15)
    assert np.array_equal(x[:9], Noise(rms=0.3, low=1.0, high=4.0, seed=3, lines=600)(t[:9]))
    assert not np.array_equal(x[:9], Noise(rms=0.3, low=1.0, high=4.0, seed=4, lines=600)(t[:9]))


def test_an_engine_offset_turns_the_vehicle_until_the_engine_is_straight():
    """Thrust offset e: in equilibrium beta = a0 phi + e = 0."""
    run = simulate(paper_case(xi(0.08), attitude_gain=0.3, rate_gain=1.2), 150.0, 0.0, engine=Step(size=1e-3))
    assert run.attitude[-1] == pytest.approx(-1e-3 / 0.3, rel=1e-4)
    assert run.tvc[-1] == pytest.approx(0.0, abs=1e-7)


def test_histories_of_disturbances_add_up_in_a_linear_loop():
    case = paper_case(xi(0.06), vehicle=AIR, delay=0.05, actuator=Actuator(frequency=30.0, damping=0.7))
    gust, pulse = OneMinusCosine(size=9.0, duration=3.0, start=1.0), Pulse(size=1e-3, duration=2.0, start=4.0)
    both = simulate(case, 30.0, 0.0, wind=gust, engine=pulse, rtol=1e-10)
    apart = [simulate(case, 30.0, 0.0, rtol=1e-10, **{name: x}) for name, x in (("wind", gust), ("engine", pulse))]
    assert np.max(np.abs(both.slosh)) > 1e-3
    assert np.max(np.abs(apart[0].tvc)) > 1e-5
    np.testing.assert_allclose(both.slosh, apart[0].slosh + apart[1].slosh, atol=1e-9 * np.abs(both.slosh).max())


def test_a_vehicle_in_constant_wind_ends_up_drifting_with_it():
    """alpha, phi and beta all vanish: attitude is back at zero though the wind blows on."""
    case = paper_case(xi(0.08), vehicle=AIR, attitude_gain=0.5, rate_gain=1.5)
    run = simulate(case, 1500.0, 0.0, wind=Step(size=10.0), step=0.05)
    assert np.max(np.abs(run.attitude)) > 1e-5
    assert abs(run.attitude[-1]) < 0.01 * np.max(np.abs(run.attitude))


def test_wind_without_air_and_noise_longer_than_its_period_are_refused():
    with pytest.raises(ValueError, match="aerodynamics"):
        simulate(paper_case(), 10.0, wind=Step(size=1.0))
    with pytest.raises(ValueError, match="repeats"):
        simulate(paper_case(), 100.0, engine=Noise(rms=1e-3, low=1.0, high=4.0, lines=10))


@pytest.mark.parametrize("p", [0.5, 1.0, 2.0])
def test_stochastic_damping_of_a_power_law_is_its_gaussian_moment(p):
    law, w, sigma = PowerDamping(slope=0.1, exponent=p), 2.0, 0.3
    g = 2 / math.sqrt(math.pi) * math.gamma((p + 3) / 2) / math.gamma((p + 4) / 2)
    c = 2 * 0.1 * w ** (1 - p) / g
    moment = 2 ** ((p + 2) / 2) * math.gamma((p + 3) / 2) / math.sqrt(math.pi)  # E|x|^(p+2)
    assert stochastic_ratio(law, sigma, w) == pytest.approx(c * sigma**p * moment / (2 * w), rel=1e-8)
    if p == 1.0:
        b = 3 * math.pi * 0.1 / 4
        assert stochastic_ratio(law, sigma, w) == pytest.approx(b * math.sqrt(8 / math.pi) * sigma / (2 * w), rel=1e-8)


def test_stochastic_damping_of_constants_sums_and_tables():
    wall, wave = ConstantDamping(ratio=0.01), PowerDamping(slope=0.1)
    assert stochastic_ratio(wall, 0.3, 2.0) == pytest.approx(0.01, rel=1e-10)
    both = stochastic_ratio(SumDamping(of=(wall, wave)), 0.3, 2.0)
    assert both == pytest.approx(0.01 + stochastic_ratio(wave, 0.3, 2.0), rel=1e-10)
    A = np.linspace(0.0, 1.0, 11)
    table = TableDamping(amplitude=A, ratio=0.1 * A)
    # four standard deviations of the formula's eight
    assert stochastic_ratio(table, 0.3, 2.0) == pytest.approx(stochastic_ratio(wave, 0.3, 2.0), rel=3e-3)
    with pytest.raises(OutsideValidity, match="four standard deviations"):
        stochastic_ratio(table, 0.6, 2.0)
    ends = PowerDamping(slope=0.1, largest_amplitude=1.0)
    assert stochastic_ratio(ends, 0.3, 2.0) == pytest.approx(stochastic_ratio(wave, 0.3, 2.0), rel=3e-3)
    with pytest.raises(OutsideValidity, match="end at 1 m, but four standard deviations"):
        stochastic_ratio(ends, 0.6, 2.0)


def test_rms_of_a_linear_loop_is_the_integral_of_the_oracles_response():
    case = paper_case(xi(0.06), delay=0.05)
    noise = Noise(rms=1e-3, low=BAND[0], high=BAND[1])
    found = forced_response(case, engine=noise)
    numbers = oracle.numbers(case, 0.06)

    def squared(omega, which):
        L, z = oracle.solved(numbers, np.array(1j * omega))[:2]
        beta = 1 / (1 + complex(L))  # from a command disturbance to the engine
        return abs(beta if which == "tvc" else complex(z[0]) * beta) ** 2

    for which, value in (("tvc", found.tvc), ("slosh", found.slosh[0])):
        area = quad(squared, *BAND, args=(which,), points=[2.0, 2.1, 2.2], limit=400, epsrel=1e-10)[0]
        assert value == pytest.approx(1e-3 * math.sqrt(area / (BAND[1] - BAND[0])), rel=1e-8)


@pytest.mark.parametrize("source", ["engine", "wind"])
def test_rms_is_that_of_a_long_simulation(source):
    law = SumDamping(of=(ConstantDamping(ratio=0.04), PowerDamping(slope=0.2)))
    case = paper_case(law, vehicle=AIR, delay=0.03)
    rms = {"engine": 2e-3, "wind": 8.0}[source]
    noise = Noise(rms=rms, low=0.8, high=3.5, seed=5, lines=1300)
    predicted = forced_response(case, **{source: noise})
    run = simulate(case, 2500.0, 0.0, step=0.08, **{source: noise})
    settled = run.time > 150.0
    z = run.slosh[settled, 0]
    # 2500 s hold some 120 independent swings of this narrow band: 4 % of sampling; the damper's shape adds little
    assert np.sqrt(np.mean(z**2)) == pytest.approx(predicted.slosh[0], rel=0.06)
    assert np.sqrt(np.mean(run.tvc[settled] ** 2)) == pytest.approx(predicted.tvc, rel=0.06)
    assert predicted.damping[0] > 0.045  # the wave's part counts


def test_a_loop_that_cycles_by_itself_has_no_gaussian_rms():
    with pytest.raises(OutsideValidity, match="by itself"):
        forced_response(paper_case(), engine=Noise(rms=1e-3, low=1.0, high=4.0))
    with pytest.raises(ValueError, match="noise"):
        forced_response(paper_case(xi(0.06)))
    assert norm.cdf(4.0) > 0.9999
