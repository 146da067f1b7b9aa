"""Limit cycles with the engine at its limits, against simulation and closed forms of the describing functions."""

import math

import numpy as np
import pytest

from cases import paper_case, xi
from sloshpy.assess import assess
from sloshpy.autopilot import Actuator
from sloshpy.damping import PowerDamping, SumDamping
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import degradation_map, limit_cycles, two_axis_cycles
from sloshpy.limit_cycle.engine_limits import actuator_factor
from sloshpy.simulation import simulate, simulate_ensemble, simulate_two_axes
from sloshpy.vehicle import Aerodynamics, SloshMass

DEGRADED = {"gain": 10 ** (4.4 / 20), "delay": 0.17}


def test_a_fast_actuator_with_a_stop_has_the_saturations_describing_function():
    """(2/pi)(asin r + r sqrt(1 - r^2)), r = stop over command."""
    fast = Actuator(frequency=1e4, damping=1.0, deflection_limit=1e-3)
    for command in (1.5e-3, 3e-3, 1e-2):
        r = 1e-3 / command
        factor, peak = actuator_factor(fast, command, 10.0)
        assert factor == pytest.approx(2 / math.pi * (math.asin(r) + r * math.sqrt(1 - r * r)), rel=2e-3)
        assert peak == pytest.approx(1e-3, rel=1e-3)


def test_a_fast_actuator_with_a_dead_band_has_its_describing_function():
    fast = Actuator(frequency=1e4, damping=1.0, deadband=1e-3)
    for command in (1.2e-3, 3e-3, 1e-2):
        r = 1e-3 / command
        closed = 1 - 2 / math.pi * (math.asin(r) + r * math.sqrt(1 - r * r))
        assert actuator_factor(fast, command, 10.0)[0] == pytest.approx(closed, abs=2e-3)
    assert abs(actuator_factor(fast, 0.9e-3, 10.0)[0]) < 1e-8


def test_far_beyond_its_rate_an_engine_moves_in_a_triangle():
    """Slope R, period 2 pi/W: peak R pi/(2W), fundamental 8/pi^2 of it, a quarter turn behind."""
    slow = Actuator(frequency=1e3, damping=1.0, rate_limit=0.01)
    factor, peak = actuator_factor(slow, 0.5, 2.0)
    assert peak == pytest.approx(0.01 * math.pi / 4, rel=0.02)
    assert abs(factor) * 0.5 == pytest.approx(8 / math.pi**2 * 0.01 * math.pi / 4, rel=0.02)
    assert math.degrees(np.angle(factor)) == pytest.approx(-90.0, abs=3.0)


def test_within_its_limits_an_engine_is_linear():
    calm = Actuator(frequency=30.0, damping=0.7, deflection_limit=0.1, rate_limit=1.0)
    assert actuator_factor(calm, 1e-3, 2.0)[0] == 1.0
    (cycle,), (plain,) = (limit_cycles(paper_case(actuator=a)) for a in (calm, Actuator(frequency=30.0, damping=0.7)))
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(plain.slosh_amplitude["LOX"], rel=1e-6)
    assert cycle.tvc_amplitude == pytest.approx(plain.tvc_amplitude, rel=1e-6)


@pytest.mark.parametrize(
    ("limits", "autopilot"),
    [({"deflection_limit": 2e-3}, DEGRADED), ({"rate_limit": 1.5e-3}, {}), ({"deadband": 1e-4}, {})],
    ids=["stop", "rate", "dead band"],
)
def test_the_cycle_at_a_limit_is_the_simulated_one(limits, autopilot):
    """T31: a stop of 2 mrad makes 0.32 m of what would be 0.447 m."""
    case = paper_case(actuator=Actuator(frequency=60.0, damping=0.7, **limits), **autopilot)
    stable = [c for c in limit_cycles(case) if c.stable]
    (cycle,) = stable
    a = cycle.slosh_amplitude["LOX"]
    run = simulate(case, 350.0, 0.95 * a)
    # the clipped engine's third harmonic is left out: half a percent
    assert a == pytest.approx(run.slosh_envelope().amplitude, rel=6e-3)
    assert cycle.omega == pytest.approx(run.slosh_envelope().omega, rel=2e-3)
    last = run.tvc[run.time > 300.0]
    assert cycle.tvc_amplitude == pytest.approx(0.5 * np.ptp(last), rel=1.5e-2)
    if "deflection_limit" in limits:
        assert a == pytest.approx(0.320, rel=1e-2)


def test_a_dead_band_leaves_a_small_unstable_cycle_that_parts_rest_from_the_large_one():
    case = paper_case(actuator=Actuator(frequency=60.0, damping=0.7, deadband=1e-4))
    small, large = sorted(limit_cycles(case), key=lambda c: c.slosh_amplitude["LOX"])
    assert (small.stable, large.stable) == (False, True)
    a = small.slosh_amplitude["LOX"]
    ends = [np.max(np.abs(simulate(case, 350.0, f * a).slosh[-500:])) for f in (0.85, 1.15)]
    assert ends[0] < 0.8 * a
    assert ends[1] > 1.5 * a


def test_what_knows_no_limits_refuses_them_instead_of_leaving_them_out():
    dead = paper_case(actuator=Actuator(frequency=60.0, damping=0.7, deadband=1e-4))
    stop = paper_case(actuator=Actuator(frequency=60.0, damping=0.7, deflection_limit=1e-3))
    for verb in (simulate_ensemble, simulate_two_axes, two_axis_cycles):
        with pytest.raises(OutsideValidity, match="dead band"):
            verb(dead)
    with pytest.raises(OutsideValidity, match="limits"):
        two_axis_cycles(stop)
    cells = degradation_map(stop, gain_db=np.array([-6.0, 0.0, 3.0]), delay=np.array([0.0, 0.1]))
    assert np.all(np.isnan(cells.tvc[1:]))  # 1.2 mrad and more
    assert np.all(cells.tvc[0] < 1e-3)


def test_an_unstable_vehicle_with_a_dead_band_gets_no_verdict():
    """The engine stands still within the band, where the air turns the vehicle over: its kicks are no sinusoid."""
    air = Aerodynamics(normal_force_slope=1.5e5, center_of_pressure=10.0, speed=300.0)
    damped = {"slosh_mass": 300.0, "station": 4.0, "frequency": 2.4}
    second = SloshMass(name="B", slosh_mass=200.0, station=8.0, frequency=2.5, damping=xi(0.06))
    dead = Actuator(frequency=12.0 * np.pi, damping=0.7, deadband=np.radians(1.5))
    gains = {"attitude_gain": 1.2, "rate_gain": 0.9, "delay": 0.02}
    case = paper_case(xi(0.05), vehicle={"aerodynamics": air}, tank=damped, more=(second,), actuator=dead, **gains)
    review = assess(case)
    assert review.margins.stable
    run = simulate(case, 300.0, 0.01)
    assert np.max(np.abs(run.tvc[-4000:])) > review.case.criteria.tvc_amplitude  # it moves the engine too much
    assert review.verdict == "invalid"
    assert "dead band leaves no gain" in review.reasons[0]
    # the same vehicle without air rests within the band
    calm = paper_case(xi(0.06), actuator=Actuator(frequency=60.0, damping=0.7, deadband=1e-4))
    assert assess(calm).verdict == "pass"


def test_limits_that_are_never_met_change_no_cycle():
    """The branch of these two tanks turns back in amplitude, which steps in amplitude cannot follow."""
    floor = SumDamping(of=(xi(0.001), PowerDamping(slope=0.12)))
    lox = {"slosh_mass": 600.0, "station": 9.0, "frequency": 2.0}
    lh2 = SloshMass(name="LH2", slosh_mass=250.0, station=2.5, frequency=2.1, damping=floor)
    engine = {"frequency": 12.0 * np.pi, "damping": 0.7}
    free, held = (
        paper_case(PowerDamping(slope=0.12), tank=lox, more=(lh2,), delay=0.02, actuator=Actuator(**engine, **limit))
        for limit in ({}, {"rate_limit": np.radians(15.0), "deflection_limit": np.radians(6.0)})
    )
    one, other = limit_cycles(free), limit_cycles(held)
    assert len(one) == len(other) > 0
    for a, b in zip(one, other, strict=True):
        assert b.tvc_amplitude == pytest.approx(a.tvc_amplitude, rel=1e-12)
        assert b.disturbance == pytest.approx(a.disturbance, rel=1e-9)
    settled = simulate(held, 1500.0, 0.2)
    assert settled.tvc_envelope.amplitude == pytest.approx(other[0].tvc_amplitude, rel=5e-3)
