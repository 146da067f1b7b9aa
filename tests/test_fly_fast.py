"""The compiled simulation of a flight: the plain one, equations written out and solved by SciPy, a closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flying import AIR, BENDING, LIMITED, MIXED, SECOND, SOFT, TABLE, WIDE, burn, with_laws
from sloshpy.autopilot import Autopilot
from sloshpy.case import Case
from sloshpy.damping import PowerDamping
from sloshpy.errors import OutsideValidity
from sloshpy.flight import Phase, simulate_flight
from sloshpy.flight.fly_fast import fly_fast
from sloshpy.flight.peaks import Course, stretches
from sloshpy.simulation import OneMinusCosine
from sloshpy.vehicle import SloshMass, Vehicle

ENDS = PowerDamping(slope=0.01, largest_amplitude=0.2)
FILTERED = {"late": (0.03, 0.05), "actuator": LIMITED}
FELT = {"vehicle": {"accelerometer_station": 8.0}, "accelerometer_gain": 2e-3, "actuator": LIMITED}
SWITCHED = (burn(filter=(SOFT,), **FILTERED), burn(12.0, 24.0, name="on", filter=(WIDE, SOFT), **FILTERED))
_ALONG = np.linspace(0.0, 1.0, 5)
MOVING = {
    "filter": (SOFT.model_copy(update={"denominator": (1.0, 14.4 + 6.0 * _ALONG, 144.0)}),),
    "actuator": LIMITED.model_copy(update={"frequency": 20.0 - 5.0 * _ALONG, "damping": 0.7 + 0.2 * _ALONG}),
}
FLIGHTS = {
    "a filter and an actuator with limits that move": burn(late=(0.03, 0.05), **MOVING),
    "square law": burn(),
    "two tanks, moving delay": burn(late=(0.02, 0.06), more=(SECOND,)),
    "engine limits without a delay": burn(actuator=LIMITED),
    "air, bending and a delay below the step": burn(
        vehicle={"aerodynamics": AIR, "flexible_modes": (BENDING,)}, late=(0.011, 0.004), actuator=LIMITED
    ),
    "sum with a table": burn(law=MIXED),
    "another law at each time": with_laws(burn(count=4), (MIXED, PowerDamping(slope=0.1), TABLE, MIXED)),
    "accelerometer": burn(late=(0.03, 0.03), **FELT),
    "accelerometer across an event": (
        burn(name="before", late=(0.03, 0.03), **FELT),
        burn(12.0, 24.0, name="on", late=(0.05, 0.05), **FELT),
    ),
    "other filters from an event on": SWITCHED,
    "an event that changes the delay": (burn(late=(0.02, 0.02)), burn(12.0, 24.0, name="on", late=(0.1, 0.15))),
}


@pytest.mark.parametrize("flight", FLIGHTS.values(), ids=FLIGHTS)
def test_the_compiled_flight_is_the_plain_one(flight):
    tanks = len((flight if isinstance(flight, Phase) else flight[0]).tanks)
    slosh = np.array([0.3, -0.2])[:tanks]
    fast, plain = fly_fast(flight, slosh), simulate_flight(flight, slosh)
    assert np.array_equal(fast.time, plain.time)
    assert fast.stopped == plain.stopped == ""
    assert np.max(np.abs(fast.slosh - plain.slosh)) < 1e-11
    assert np.max(np.abs(fast.tvc - plain.tvc)) < 1e-11
    assert np.max(np.abs(fast.tvc)) > 1e-4


def test_limits_are_met_in_these_flights():
    """So that what is compared above is compared at the limits too."""
    tvc = fly_fast(FLIGHTS["engine limits without a delay"], np.array([0.3])).tvc
    assert np.max(np.abs(tvc)) == pytest.approx(LIMITED.deflection_limit, rel=1e-12)


@pytest.mark.parametrize(
    ("flight", "words"),
    [
        (
            burn(law=PowerDamping(slope=0.01, largest_amplitude=0.2), attitude_gain=0.3, late=(0.3, 0.3)),
            "beyond the damping data at ",
        ),
        (burn(attitude_gain=2.0, rate_gain=2.0, end=24.0, late=(0.3, 0.3)), "diverged at "),
    ],
)
def test_a_flight_that_ends_early_says_when_and_why(flight, words):
    fast, plain = fly_fast(flight, np.array([0.15])), simulate_flight(flight, np.array([0.15]))
    assert fast.stopped.startswith(words)
    assert (fast.stopped, len(fast.time)) == (plain.stopped, len(plain.time))


def test_the_step_is_fine_enough():
    for name in (
        "two tanks, moving delay",
        "air, bending and a delay below the step",
        "other filters from an event on",
    ):
        flight = FLIGHTS[name]
        slosh = np.full(2 if name.startswith("two") else 1, 0.3)
        usual = fly_fast(flight, slosh)
        fine = fly_fast(flight, slosh, step=0.2 * usual.step)
        for one, other in ((usual.slosh[:, 0], fine.slosh[:, 0]), (usual.tvc, fine.tvc)):
            peaks = [Course.of(h.time, x).greatest()[0] for h, x in ((usual, one), (fine, other))]
            assert peaks[0] == pytest.approx(peaks[1], rel=1e-4), name


def test_a_gust_on_a_burn_is_that_of_its_equations_written_out():
    """theory.md section 2 by LSODA, every number a function of time, not of a table."""
    gust = OneMinusCosine(size=15.0, start=3.0, duration=5.0)
    phase = burn(end=24.0, count=481, vehicle={"aerodynamics": AIR})
    found = fly_fast(phase, np.array([0.1]), gust, damping_factor=0.7)

    def motion(t, y):
        s = t / 24.0
        phi, z, drift, rate, v = y
        M, I, X, F = 16e3 * (1.0 - 0.4 * s), 9e5 * (1.0 - 0.2 * s), 6.0 + 0.3 * s, 9e5 * (1.0 + 0.05 * s)
        m, w, l = 1e3 * (1.0 - 0.4 * s), 2.0 * np.sqrt(1.0 + 0.8 * s), X - 9.0 + s
        dm, a = -1e3 * 0.4 / 24.0, F / M
        beta = 0.08 * (1.0 - 0.2 * s) * phi + 0.14 * rate
        blows = 7.5 * (1.0 - np.cos(2.0 * np.pi * (t - 3.0) / 5.0)) if 3.0 < t < 8.0 else 0.0
        lift = 2e5 * (phi - (drift - blows) / 400.0)
        b = 0.7 * 0.75 * np.pi * 0.1  # eq 19
        # unknown Z'', phi'' and z''; (m z')' = m z'' + m' z' in every row, eqs 1-3
        rows = np.array([[M, 0.0, m], [0.0, I, -m * l], [1.0, -l, 1.0]])
        right = [
            F * beta + M * a * phi + lift - dm * v,
            -F * X * beta + (8.0 - X) * lift + m * a * z + dm * l * v,
            a * phi - w**2 * z - b * abs(v) * v - dm / m * v,
        ]
        away, turn, swing = np.linalg.solve(rows, right)
        return [rate, v, away, turn, swing]

    first = [0.0, 0.1, 0.0, 0.0, 0.0]
    usual = {"method": "LSODA", "rtol": 1e-9, "atol": 1e-12, "max_step": 0.05, "t_eval": found.time[:-1]}
    wanted = solve_ivp(motion, (0.0, 24.0), first, **usual)
    assert wanted.success
    s = wanted.t / 24.0
    beta = 0.08 * (1.0 - 0.2 * s) * wanted.y[0] + 0.14 * wanted.y[3]
    assert np.max(np.abs(found.slosh[:-1, 0] - wanted.y[1])) < 2e-4 * np.max(np.abs(wanted.y[1]))
    assert np.max(np.abs(found.tvc[:-1] - beta)) < 2e-4 * np.max(np.abs(beta))
    calm = fly_fast(phase, np.array([0.1]), damping_factor=0.7)
    change = np.abs(np.interp(found.time, calm.time, calm.tvc) - found.tvc)
    assert np.max(change) > 0.3 * np.max(np.abs(found.tvc))  # so that the gust counts
    assert np.max(change[found.time < 3.0]) < 1e-6


@pytest.mark.parametrize("stiffened", [1.0, 2.0, 0.6])
def test_a_slosh_mass_that_stiffens_slowly_falls_as_the_averaged_equation_says(stiffened):
    """b^2 m w A'' averaged: (A w^1/2)' = -alpha w^1/2 (A w^1/2)^2 for the square law, so 1/(A w^1/2) grows with it."""
    time = np.linspace(0.0, 120.0, 241)
    w = 2.0 * stiffened ** (time / 120.0)
    tank = SloshMass(name="T", slosh_mass=0.01, station=5.0, frequency=w, damping=PowerDamping(slope=0.05))
    vehicle = Vehicle(mass=1e6, inertia=1e8, cg=5.0, thrust=1e7, tanks=(tank,))
    case = Case(name="alone", vehicle=vehicle, autopilot=Autopilot(attitude_gain=0.5, rate_gain=1.0))
    found = fly_fast(Phase(name="alone", time=time, case=case), np.array([0.4]), damping_factor=1.5)
    top, peak = found.peaks(0)
    root = np.sqrt(w)
    grown = np.concatenate([[0.0], np.cumsum(0.25 * (root[1:] + root[:-1]))])  # of the integral of w^1/2, 0.5 s apart
    # from the first peak on, since the averaged start is not the first displacement itself
    whole = 0.075 * np.interp(top, time, grown)
    inverse = 1.0 / (peak * np.sqrt(np.interp(top, time, w)))
    assert inverse - inverse[0] == pytest.approx(whole - whole[0], abs=2e-3 * inverse[-1])
    assert peak[-1] < 0.15


def test_what_a_flight_cannot_be_simulated_with_is_refused():
    with pytest.raises(OutsideValidity, match="sampler"):
        fly_fast(burn(sample_time=0.02, late=(0.02, 0.02)), np.array([0.1]))
    other = burn(12.0, 24.0, name="on", vehicle={"mass": 1e4})
    with pytest.raises(OutsideValidity, match="something leaves"):
        fly_fast((burn(), other), np.array([0.1]))
    with pytest.raises(ValueError, match="step must be > 0"):
        fly_fast(burn(), np.array([0.1]), step=0.0)


def test_a_course_finds_the_extremes_between_its_steps():
    time = np.arange(0.0, 20.0, 0.05)  # a tenth of a radian, as the march has at most of slosh
    course = Course.of(time, 3.0 * np.exp(-0.05 * time) * np.cos(2.0 * time))
    inner = Course.of(time, np.cos(2.0 * time))
    near = [float(np.max(np.abs(inner.value[np.abs(inner.time - t) < 0.1]))) for t in 0.5 * np.pi * np.arange(1, 12)]
    # (h/2)/6 of the third derivative, times (h/2)(h/2)(3h/2): h^4 / 32
    assert np.max(np.abs(np.array(near) - 1.0)) < 0.1**4 / 32.0
    assert course.greatest() == (3.0, 0.0)
    # last period: extremes half a swing apart, of which the greater is the earlier one
    last = np.exp(-0.05 * (time[-1] - np.pi * np.arange(1, -0.1, -0.5)))
    assert last[0] * 3.0 > course.amplitude(np.pi) > last[-1] * 3.0


def test_the_greatest_about_each_time_is_that_of_its_own_window():
    phase = burn(0.0, 8.0, 5)
    time = np.arange(0.0, 8.01, 0.01)
    course = Course.of(time, -time)
    assert course.about(phase) == pytest.approx([1.0, 3.0, 5.0, 7.0, 8.0], rel=1e-12)
    assert Course.of(time, 8.0 - time).about(phase) == pytest.approx([8.0, 7.0, 5.0, 3.0, 1.0], rel=1e-12)
    half = Course.of(time[:451], time[:451])  # ends within the third window
    assert np.isnan(half.about(phase)).tolist() == [False, False, True, True, True]
    coarse = Course.of(np.array([0.0, 8.0]), np.array([0.0, 8.0]))  # no step in the inner windows
    assert coarse.about(phase) == pytest.approx([1.0, 3.0, 5.0, 7.0, 8.0], rel=1e-12)


def test_stretches_part_where_nothing_is_carried():
    phases = [replace(burn(), name=name) for name in "abcd"]
    runs = stretches(phases, [True, False, False])
    assert [[p.name for p in run] for run in runs] == [["a", "b"], ["c"], ["d"]]
