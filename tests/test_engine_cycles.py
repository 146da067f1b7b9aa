"""Large cycles of an engine at its limits that slosh does not carry: closed form and simulation on both sides."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

import oracle_flexible as second
from cases import paper_case, xi
from sloshpy.assess import assess
from sloshpy.autopilot import Actuator
from sloshpy.damping import PowerDamping
from sloshpy.limit_cycle import limit_cycles, slosh_cycles
from sloshpy.limit_cycle.engine_cycles import engine_cycles
from sloshpy.simulation import Pulse, simulate
from sloshpy.vehicle import Aerodynamics, SloshMass

FUEL = SloshMass(name="FUEL", slosh_mass=200.0, station=3.0, frequency=2.6, damping=xi(0.08))
STOP = 0.5 * np.pi / 180.0


def vehicle(law=None, fuel=FUEL, air=None, limits=None, **pilot):
    """A stage with 3 % of its mass in two well-damped tanks; `limits` of its engine."""
    return paper_case(
        law or xi(0.08),
        tank={"slosh_mass": 300.0},
        more=(fuel,),
        vehicle={"aerodynamics": air} if air else {},
        **{"attitude_gain": 0.3, "rate_gain": 0.5, "delay": 0.03} | pilot,
        actuator=Actuator(frequency=37.0, damping=0.7, **(limits or {})),
    )


GUIDED = {"drift_gain": 3e-4, "drift_rate_gain": 4e-3}
AIR = Aerodynamics(normal_force_slope=3e5, center_of_pressure=9.0, speed=400.0)


STOPPED = [
    vehicle(**GUIDED, limits={"deflection_limit": STOP}),
    vehicle(air=AIR, attitude_gain=0.5, rate_gain=0.6, limits={"deflection_limit": 2.0 * STOP}),
]
SLOW = vehicle(limits={"rate_limit": np.radians(2.0)})


def solved(case, w):
    """L and |z/beta| of the second implementation at the tanks' constant damping."""
    L, z, _ = second.solved(
        second.second_order(case.vehicle, np.array([0.08, 0.08])), case.autopilot, np.array([1j * w])
    )
    return complex(L[0]), np.abs(z[0])


@pytest.mark.parametrize("case", STOPPED, ids=["guided", "air"])
def test_an_engine_at_its_stop_has_the_cycle_of_a_static_saturation(case):
    """2/pi (asin u + u sqrt(1 - u^2)) = 1/|L| where L is real; the engine is fast."""
    (cycle,) = engine_cycles(case)
    omega = scipy.optimize.brentq(lambda w: solved(case, w)[0].imag, 0.9 * cycle.omega, 1.1 * cycle.omega)
    L, per_engine = solved(case, omega)
    assert L.real < -1.0
    share = scipy.optimize.brentq(
        lambda u: 2.0 / np.pi * (np.arcsin(u) + u * np.sqrt(1.0 - u * u)) + 1.0 / L.real, 1e-3, 1.0
    )
    stop = case.autopilot.actuator.deflection_limit
    assert cycle.omega == pytest.approx(omega, rel=2e-3)
    assert list(cycle.slosh_amplitude.values()) == pytest.approx(stop / share / abs(L) * per_engine, rel=5e-3)
    assert cycle.tvc_amplitude == pytest.approx(stop, rel=5e-3)
    assert not cycle.stable


def test_an_engine_at_its_rate_has_the_cycle_of_a_triangle():
    """It lags by acos(pi^2 / (8 |L|)), with 4 R / (pi W B) for a gain: its angle is a triangle of pi R / (2 W).

    To 4 %: the lag of the linear actuator, 0.05 rad, which stands in L as well, is in part the triangle's own.
    """
    (cycle,) = engine_cycles(SLOW)

    def apart(w):
        L, _ = solved(SLOW, w)
        return np.angle(-L) - np.arccos(np.pi**2 / 8.0 / abs(L))

    omega = scipy.optimize.brentq(apart, 0.8 * cycle.omega, 1.2 * cycle.omega)
    rate = SLOW.autopilot.actuator.rate_limit
    assert cycle.omega == pytest.approx(omega, rel=0.04)
    assert cycle.tvc_amplitude == pytest.approx(0.5 * np.pi * rate / cycle.omega, rel=0.01)
    assert list(cycle.slosh_amplitude.values()) == pytest.approx(
        4.0 * rate / np.pi / cycle.omega * solved(SLOW, cycle.omega)[1], rel=0.02
    )
    assert not cycle.stable


@pytest.mark.parametrize(
    ("case", "inside", "outside"),
    [(STOPPED[0], (2.0, 3.0), (3.0, 6.0)), (STOPPED[1], (2.8, 3.0), (4.5, 3.0)), (SLOW, (2.5, 3.0), (6.0, 3.0))],
    ids=["guided", "air", "rate"],
)
def test_the_simulation_comes_back_within_the_cycle_and_not_from_beyond(case, inside, outside):
    """Pulses in deg and s; what is listed and told is the edge between them."""

    def motion(size, duration):
        pulse = Pulse(size=np.radians(size), start=0.0, duration=duration)
        run = simulate(case, duration=60.0, initial_slosh=0.0, engine=pulse)
        return np.inf if run.stopped else np.max(np.abs(run.slosh[run.time > 50.0]))

    (cycle,) = engine_cycles(case)
    least = min(cycle.slosh_amplitude.values())
    assert motion(*inside) < 0.3 * least
    assert motion(*outside) > 3.0 * least
    reasons = assess(case).reasons
    assert any("unstable limit cycle with the engine at its limits" in reason for reason in reasons)


def test_limits_that_nothing_reaches_leave_no_cycle():
    assert engine_cycles(vehicle()) == ()
    assert engine_cycles(vehicle(limits={"deflection_limit": 0.3})) == ()  # no gain is needed, below 1 rad of command


def test_cycles_of_slosh_and_of_the_engine_stand_beside_each_other(monkeypatch):
    case = paper_case(PowerDamping(slope=0.02), actuator=Actuator(frequency=20.0, damping=0.7, rate_limit=0.004))
    slosh, engine = (
        slosh_cycles(case),
        engine_cycles(case)[:1],
    )  # the slosh cycle may be met again, at its own frequency
    assert [c.stable for c in (*slosh, *engine)] == [True, False]
    assert engine[0].omega < 0.5 * slosh[0].omega
    assert limit_cycles(case) == (*slosh, *engine)
    monkeypatch.setattr("sloshpy.limit_cycle.cycles.engine_cycles", lambda _: (replace(slosh[0], tank=""), *engine))
    assert limit_cycles(case) == (*slosh, *engine)  # both ways to one cycle
