"""Growth and simulation across events and with a changing delay: closed form, a second implementation, simulation."""

import numpy as np
import pytest

from sloshpy.autopilot import Autopilot, Filter
from sloshpy.case import Case
from sloshpy.damping import ConstantDamping
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_case, read_flight, write_example
from sloshpy.flight import Phase, Trajectory, check_growth, growth_across, simulate_flight
from sloshpy.flight.command_record import delays, emptied_after
from sloshpy.vehicle import SloshMass, Vehicle


@pytest.fixture(scope="module")
def upper_stage(tmp_path_factory):
    return read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))


def throttled(case, share, **pilot):
    """Return a case at a share of its thrust, the slosh frequency with it, the autopilot changed."""
    v, tank = case.vehicle, case.vehicle.tanks[0]
    slower = tank.model_copy(update={"frequency": tank.frequency * share**0.5})
    thrust = v.thrust * share
    body = v.model_copy(update={"thrust": thrust, "vectored_thrust": thrust, "tanks": (slower,)})
    return case.model_copy(update={"vehicle": body, "autopilot": case.autopilot.model_copy(update=pilot)})


def two(one, other, at=30.0, end=60.0):
    """Return a flight of two phases that stand still."""
    first = Phase(name="before", time=np.linspace(0.0, at, 4), case=one)
    return Trajectory(name="two", phases=(first, Phase(name="after", time=np.linspace(at, end, 4), case=other)))


def lone(frequency):
    """Return a slosh mass so light that the vehicle does not feel it, undamped."""
    tank = SloshMass(name="T", slosh_mass=0.01, station=5.0, frequency=frequency, damping=ConstantDamping(ratio=0.0))
    vehicle = Vehicle(mass=1e6, inertia=1e8, cg=5.0, thrust=1e7, tanks=(tank,))
    return Case(name="alone", vehicle=vehicle, autopilot=Autopilot(attitude_gain=0.5, rate_gain=1.0))


@pytest.mark.parametrize("after", [1.5, 3.0])
def test_a_step_of_frequency_turns_amplitude_by_where_in_the_swing_it_falls(after):
    """At the peak the slosh keeps its place, in the middle its speed: times 1 or w1/w2."""
    growth = growth_across(two(lone(2.0), lone(after)), "T", 0.1)
    ends = sorted([1.0, 2.0 / after])
    assert growth.carries[0].least / 0.1 == pytest.approx(ends[0], rel=1e-4)
    assert growth.carries[0].greatest / 0.1 == pytest.approx(ends[1], rel=1e-4)


def test_simulations_across_an_event_fill_the_band_that_is_predicted(upper_stage):
    """Throttle, gain and delay step at once; the start of the swing decides where the event falls in it."""
    flight = two(throttled(upper_stage, 1.0, delay=0.05), throttled(upper_stage, 0.6, delay=0.12, rate_gain=0.2))
    growth = growth_across(flight, 0, 0.05)
    carry = growth.carries[0]
    assert carry.greatest > 1.2 * carry.least
    high, low = [], []
    for angle in np.linspace(0.0, np.pi, 8, endpoint=False):
        check = check_growth(growth, step=0.02, angle=angle)
        assert check.worst < 0.01  # other modes that the event moves are in the first swings
        late = check.time > 45.0
        assert np.max(np.abs(check.difference[late])) < 1e-3
        high.append(check.simulated[-1] / check.predicted[-1])
        low.append(check.simulated[-1] / check.least[-1])
    assert max(high) == pytest.approx(1.0, abs=5e-3)  # of eight angles one is near the worst
    assert min(low) == pytest.approx(1.0, abs=5e-3)


def test_an_event_that_changes_nothing_is_none(upper_stage):
    late = throttled(upper_stage, 1.0, delay=0.05, filter=(Filter(numerator=(1.0,), denominator=(0.1, 1.0)),))
    whole = Phase(name="whole", time=np.array([0.0, 60.0]), case=late)
    carry = growth_across(two(late, late), 0, 0.05).carries[0]
    assert [carry.least / carry.before[0], carry.greatest / carry.before[1]] == pytest.approx([1.0, 1.0], abs=1e-9)
    there = simulate_flight(whole, np.array([0.05]), step=0.02)
    # the same filter written otherwise is another one, begun from what it has heard
    twice = throttled(upper_stage, 1.0, delay=0.05, filter=(Filter(numerator=(2.0,), denominator=(0.2, 2.0)),))
    for other in (late, twice):
        here = simulate_flight(two(late, other).phases, np.array([0.05]), step=0.02)
        slosh = np.interp(there.time, here.time, here.slosh[:, 0])
        assert np.max(np.abs(slosh - there.slosh[:, 0])) < 2e-4 * np.max(np.abs(slosh))  # np.interp: (w h)^2 / 8


def test_a_changing_delay_is_that_of_its_equations_marched_in_small_steps(upper_stage):
    """A second implementation: Heun's method in steps of 1 ms, the history read linearly between them."""
    time = np.array([0.0, 10.0, 25.0])
    delay = np.array([0.05, 0.3, 0.1])
    phase = Phase(name="late", time=time, case=throttled(upper_stage, 1.0, delay=delay))
    found = simulate_flight(phase, np.array([0.1]), step=0.02)
    M, I, X, F, m, w, l = 16e3, 9e5, 6.0, 9e5, 1e3, 2.0, -3.0  # theory sheet, the paper's vehicle
    b, h, steps = 0.75 * np.pi * 0.1, 1e-3, 25_000
    rows = np.linalg.inv(np.array([[M, 0.0, m], [0.0, I, -m * l], [1.0, -l, 1.0]]))
    told = np.zeros(steps + 1)

    def slope(t, y, n):
        past = (t - np.interp(t, time, delay)) / h
        k = int(past)
        beta = 0.0 if past < 0.0 else told[k] + (past - k) * (told[min(k + 1, n)] - told[k])
        phi, z, rate, v = y
        right = [F * beta + F * phi, -F * X * beta + m * F / M * z, F / M * phi - w**2 * z - b * abs(v) * v]
        return np.array([rate, v, *(rows @ right)[1:]])

    y, slosh = np.array([0.0, 0.1, 0.0, 0.0]), np.zeros(steps + 1)
    for n in range(steps + 1):
        slosh[n], told[n] = y[1], 0.08 * y[0] + 0.14 * y[2]
        k1 = slope(n * h, y, n)
        y = y + 0.5 * h * (k1 + slope((n + 1) * h, y + h * k1, n))
    wanted = np.interp(found.time, h * np.arange(steps + 1), slosh)
    assert np.max(np.abs(found.slosh[:, 0] - wanted)) < 1e-4 * np.max(np.abs(wanted))
    still = Phase(name="mean", time=time, case=throttled(upper_stage, 1.0, delay=0.15))
    mean = simulate_flight(still, np.array([0.1]), step=0.02)
    assert np.max(np.abs(np.interp(found.time, mean.time, mean.slosh[:, 0]) - wanted)) > 0.05 * np.max(np.abs(wanted))


@pytest.mark.parametrize(("first", "last"), [(0.05, 0.6), (0.6, 0.05)])
def test_growth_with_a_changing_delay_agrees_with_its_simulation(upper_stage, first, last):
    """What the moving delay does is 5 % here; without the pace of the line in it 0.7 and 1 % would be missing."""
    time = np.linspace(0.0, 40.0, 41)
    delay = first + (last - first) * time / 40.0
    phase = Phase(name="late", time=time, case=throttled(upper_stage, 1.0, delay=delay))
    growth = growth_across(Trajectory(name="late", phases=(phase,)), 0, 0.02)
    check = check_growth(growth, step=0.03)
    assert check.worst < 4e-3
    assert abs(np.trapezoid(growth.parts[0].adiabatic, growth.time)) > 0.04
    assert growth.ended == ""


def test_when_the_line_has_emptied_itself(upper_stage):
    ramp = Phase(name="x", time=np.array([0.0, 10.0]), case=throttled(upper_stage, 1.0, delay=np.array([0.1, 1.1])))
    assert emptied_after(ramp, delays(ramp), 0.0) == pytest.approx(0.1 / (1.0 - 0.1))  # T = 0.1 + 0.1 T
    still = Phase(name="x", time=np.array([0.0, 10.0]), case=throttled(upper_stage, 1.0, delay=0.3))
    assert emptied_after(still, delays(still), 2.0) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("pilot", "words"),
    [
        ({"delay": np.array([0.1, 1.2])}, "as fast as time passes"),
        ({"delay": np.array([0.0, 0.1])}, "0 s at some times"),
        ({"sample_time": 0.02}, "not simulated with a sampler"),
    ],
)
def test_a_delay_that_no_line_has_is_refused(upper_stage, pilot, words):
    phase = Phase(name="x", time=np.array([0.0, 1.0]), case=throttled(upper_stage, 1.0, **pilot))
    with pytest.raises(OutsideValidity, match=words):
        simulate_flight(phase, np.array([0.1]))


def test_nothing_is_carried_where_a_stage_leaves_or_time_is_missing(upper_stage):
    lighter = upper_stage.model_copy(update={"vehicle": upper_stage.vehicle.model_copy(update={"mass": 12e3})})
    flight = two(upper_stage, lighter)
    growth = growth_across(flight, 0, 0.05)
    assert len(growth.parts) == 1
    assert "something leaves" in growth.ended
    assert "ends at 30 s: no oscillation is carried on" in str(growth)
    with pytest.raises(OutsideValidity, match="something leaves"):
        simulate_flight(flight.phases, np.array([0.1]))
    renamed = upper_stage.vehicle.tanks[0].model_copy(update={"name": "RP-1"})
    other = upper_stage.model_copy(update={"vehicle": upper_stage.vehicle.model_copy(update={"tanks": (renamed,)})})
    assert "the tanks are LOX before and RP-1 after" in growth_across(two(upper_stage, other), 0, 0.05).ended
    late = Phase(name="late", time=np.array([31.0, 40.0]), case=upper_stage)
    apart = Trajectory(name="x", phases=(flight.phases[0], late))
    assert "1 s lie between" in growth_across(apart, 0, 0.05).ended
    with pytest.raises(OutsideValidity, match="lies in no phase"):
        growth_across(apart, 0, 0.05, 30.5)


def test_the_filter_switch_of_the_shipped_ascent_is_passed(tmp_path):
    flight = read_flight(write_example("two_stage_ascent", tmp_path))
    growth = growth_across(flight, "LOX", 0.01, 75.0, 90.0)
    assert growth.carries[0].event.changes == ("other filters",)
    check = check_growth(growth)
    assert check.worst < 0.02
    assert check.time[-1] > 85.0
