"""Limit cycles against a harmonic-balance root solve, another library and the five steps by hand."""

import control
import numpy as np
import pytest

import oracle
from cases import paper_case, xi
from sloshpy.assess import assess
from sloshpy.autopilot import Actuator
from sloshpy.damping import PowerDamping, SumDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import limit_cycles, predict_limit_cycle
from sloshpy.vehicle import SloshMass

DEGRADED = {"gain": 10 ** (4.4 / 20), "delay": 0.170}


@pytest.mark.parametrize("autopilot", [{}, DEGRADED, {"actuator": Actuator(frequency=25.0, damping=0.7)}])
@pytest.mark.parametrize("law", [PowerDamping(slope=0.1), PowerDamping(slope=0.05, exponent=0.5)])
def test_single_tank_cycle_solves_the_harmonic_balance(autopilot, law):
    case = paper_case(law, **autopilot)
    (cycle,) = limit_cycles(case)
    A, W, beta = oracle.limit_cycle(oracle.numbers(case, 0.0), lambda a: float(law.ratio(a)), 0.3, 2.13)
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(A, rel=1e-8)
    assert cycle.omega == pytest.approx(W, rel=1e-9)
    assert cycle.tvc_amplitude == pytest.approx(beta, rel=1e-8)


def test_degraded_cycle_is_0_4463_m_by_describing_function():
    (cycle,) = limit_cycles(paper_case(**DEGRADED))
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(0.4463, abs=5e-5)


def test_describing_function_of_python_control_gives_the_same_cycle():
    """The velocity loop of the slosh mass around the plant with control, closed by N(V) = 8 b V / (3 pi)."""
    c = oracle.numbers(paper_case(**DEGRADED), 0.0)
    b = 3 * np.pi * 0.1 / 4
    # from acceleration on the slosh mass to its velocity, with the loop closed: by two dampings of the oracle
    s = lambda W: 1j * W  # noqa: E731

    def velocity_per_acceleration(W):
        # 1 + L(xi) = (1 + L(0)) + ... is affine in the damping: d(char)/d(2 xi w) / char = s * response
        f0 = oracle.characteristic(c, s(W))[0]
        h = 1e-3
        f1 = oracle.characteristic(c.damped(h), s(W))[0]
        return (f1 - f0) / (2 * h * 2.0) / f0

    class Square(control.DescribingFunctionNonlinearity):
        def __call__(self, v):
            return b * v * abs(v)

        def describing_function(self, V):
            return 8 * b * V / (3 * np.pi)

        def _isstatic(self):
            return True

    from scipy.optimize import brentq

    W = brentq(lambda W: velocity_per_acceleration(W).imag, 2.11, 2.16)
    N = -1 / velocity_per_acceleration(W).real
    amplitudes = np.linspace(0.5, 1.5, 200)
    df = control.describing_function(Square(), amplitudes)
    V = np.interp(N, df.real, amplitudes)
    (cycle,) = limit_cycles(paper_case(**DEGRADED))
    assert pytest.approx(0.4463, abs=5e-5) == V / W
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(V / W, rel=1e-6)
    assert cycle.omega == pytest.approx(W, rel=1e-8)


def test_two_growing_modes_are_refused():
    """T25: at 2.3 rad/s beside 2 rad/s both grow; one sinusoid is published for neither."""
    law = PowerDamping(slope=0.1)
    case = paper_case(law, more=(SloshMass(name="b", slosh_mass=1e3, station=9.0, frequency=2.3, damping=law),))
    with pytest.raises(OutsideValidity, match="modes grow"):
        limit_cycles(case)


def test_two_tanks_locked_together_solve_the_coupled_balance():
    """One growing mode shared by two tanks, each with its own law: one frequency, amplitudes as z/beta."""
    law, wall = PowerDamping(slope=0.1), SumDamping(of=(xi(0.03), PowerDamping(slope=0.1)))
    case = paper_case(law, more=(SloshMass(name="b", slosh_mass=400.0, station=9.0, frequency=2.3, damping=wall),))
    (cycle,) = limit_cycles(case)
    ours = list(cycle.slosh_amplitude.values())
    A, W = oracle.coupled_limit_cycle(
        oracle.numbers(case, 0.0),
        [lambda a: float(law.ratio(a)), lambda a: float(wall.ratio(a))],
        [0.9 * a for a in ours],
        cycle.omega,
    )
    assert cycle.omega == pytest.approx(W, rel=1e-8)
    np.testing.assert_allclose(ours, A, rtol=1e-6)


def test_every_cycle_of_a_law_that_dips_is_listed_with_its_stability():
    """T26: a stable, an unstable and a stable one; brentq and an inverse table find only the first."""
    law = TableDamping(amplitude=[0.0, 0.07, 0.15, 0.3, 0.5, 0.8], ratio=[0.005, 0.026, 0.029, 0.020, 0.030, 0.045])
    cycles = sorted(limit_cycles(paper_case(law)), key=lambda x: x.slosh_amplitude["LOX"])
    assert [x.stable for x in cycles] == [True, False, True]
    for cycle in cycles:
        a = cycle.slosh_amplitude["LOX"]
        A, W, _ = oracle.limit_cycle(oracle.numbers(paper_case(), 0.0), lambda x: float(law.ratio(x)), a, 2.13)
        assert a == pytest.approx(A, rel=1e-7)
        assert float(law.ratio(W * A / 2.0)) == pytest.approx(0.023929, rel=1e-4)


def test_constant_damping_has_no_limit_cycle():
    assert limit_cycles(paper_case(xi(0.01))) == ()
    assert predict_limit_cycle(paper_case(xi(0.01))).acceptable is False
    assert predict_limit_cycle(paper_case(xi(0.06))).acceptable is True


def test_a_table_that_ends_too_early_gives_no_number():
    """T28: 1.5 % at 0.15 m against 4.74 % required."""
    short = TableDamping(amplitude=[0.0, 0.05, 0.15], ratio=[0.0, 0.005, 0.015])
    found = predict_limit_cycle(paper_case(short, tank={"radius": 2.5}))
    assert found.acceptable is None
    assert np.isnan(found.slosh_amplitude)
    assert any("0.15 m" in reason for reason in found.reasons)


@pytest.mark.parametrize("end", [0.3, 0.46, 0.48])
def test_a_formula_that_ends_too_early_gives_no_number(end):
    """Required is 0.4736 m in the law's own amplitude: 0.46 m refuses though the cycle's 0.444 m is less."""
    found = predict_limit_cycle(paper_case(PowerDamping(slope=0.1, largest_amplitude=end), tank={"radius": 5.0}))
    free = predict_limit_cycle(paper_case(tank={"radius": 5.0}))
    if end > 0.474:
        assert found.acceptable is True
        assert found.slosh_amplitude == free.slosh_amplitude
    else:
        assert found.acceptable is None
        assert np.isnan(found.slosh_amplitude)
        assert any(f"at {end} m" in reason for reason in found.reasons)


def test_the_verdict_of_a_formula_that_ends_is_that_of_a_table_that_ends_there():
    A = np.linspace(0.0, 0.3, 31)
    one, other = (
        assess(paper_case(law))
        for law in (PowerDamping(slope=0.1, largest_amplitude=0.3), TableDamping(amplitude=A, ratio=0.1 * A))
    )
    assert one.verdict == other.verdict == "invalid"
    assert one.reasons == other.reasons
    (a,), (b,) = one.cycles, other.cycles  # the loop as given cycles within
    assert a.slosh_amplitude["LOX"] == pytest.approx(b.slosh_amplitude["LOX"], rel=1e-6)
    early = PowerDamping(slope=0.1, largest_amplitude=0.2)  # the loop as given cycles at 0.2244 m
    with pytest.raises(OutsideValidity, match="no limit cycle that attracts is found as far as the damping data reach"):
        limit_cycles(paper_case(early))


def test_amplitude_beyond_15_percent_of_the_radius_is_said():
    wide, narrow = (predict_limit_cycle(paper_case(tank={"radius": r})) for r in (5.0, 2.0))
    assert not any("radius" in r for r in wide.reasons)
    assert any("radius" in r for r in narrow.reasons)


def test_engine_limits_below_the_prediction_void_it():
    """T31: a linear prediction beyond the actuator is no number to accept."""
    held = Actuator(frequency=300.0, damping=1.0, deflection_limit=2e-3)
    found = predict_limit_cycle(paper_case(actuator=held))
    assert found.acceptable is None
    assert any("actuator" in r for r in found.reasons)


def test_five_steps_at_another_threshold_follow_the_criteria():
    from sloshpy.case import Criteria

    loose = paper_case(criteria=Criteria(disc_margin=0.5, limit_cycle_disc_margin=0.6))
    found = predict_limit_cycle(loose)
    c = oracle.numbers(loose, float(found.required.required))
    w = np.linspace(1.9, 2.4, 200_001)
    dm = oracle.disc_margin(oracle.loop(c, 1j * w))
    assert dm.min() == pytest.approx(0.5, abs=1e-6)
    inside = w[dm < 0.6]
    np.testing.assert_allclose(found.band[0], [inside[0], inside[-1]], atol=5e-6)


def test_the_predicted_degradation_makes_the_linear_loop_neutral():

    found = predict_limit_cycle(paper_case(delay=0.05))
    degraded = paper_case(delay=0.05).autopilot.degraded(found.gain, found.delay)
    case = paper_case(delay=0.05).model_copy(update={"autopilot": degraded})
    c = oracle.numbers(case, np.array([float(found.required.required)]))
    # the oracle's own loop passes through -1 there
    assert abs(oracle.loop(c, np.array([1j * found.omega]))[0] + 1.0) < 1e-8
    assert abs(found.degraded_growth) < 1e-8
