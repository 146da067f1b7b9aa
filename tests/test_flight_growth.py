"""Growth along a flight: adiabatic invariant, the growth curve of a flight that stands still, simulation, scipy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from sloshpy.autopilot import Autopilot
from sloshpy.case import Case
from sloshpy.damping import ConstantDamping, PowerDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_case, write_example
from sloshpy.flight import Phase, check_growth, growth_along, mode_state, simulate_flight
from sloshpy.limit_cycle import growth_curve, limit_cycles
from sloshpy.simulation import simulate
from sloshpy.vehicle import SloshMass, Vehicle

TIME = np.linspace(0.0, 120.0, 121)


@pytest.fixture(scope="module")
def upper_stage(tmp_path_factory):
    return read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))


def burning(case, time, law=None):
    """Return a phase of the stage in which everything changes that a burn changes."""
    s = (time - time[0]) / (time[-1] - time[0])
    v, tank = case.vehicle, case.vehicle.tanks[0]
    own = {"frequency": 2.0 * np.sqrt(1.0 + 0.8 * s), "slosh_mass": 1000.0 * (1.0 - 0.4 * s), "station": 9.0 - s}
    moved = tank.model_copy(update=own | ({} if law is None else {"damping": law}))
    body = {"mass": 16e3 * (1.0 - 0.4 * s), "inertia": 9e5 * (1.0 - 0.2 * s), "cg": 6.0 + 0.3 * s, "tanks": (moved,)}
    body["thrust"] = body["vectored_thrust"] = 9e5 * (1.0 + 0.05 * s)
    pilot = case.autopilot.model_copy(update={"attitude_gain": 0.08 * (1.0 - 0.2 * s)})
    changed = case.model_copy(update={"vehicle": v.model_copy(update=body), "autopilot": pilot})
    return Phase(name="burn", time=time, case=changed)


def lone_oscillator(mass, frequency):
    """Return a phase with a slosh mass so light that the vehicle does not feel it, undamped."""
    tank = SloshMass(name="T", slosh_mass=mass, station=5.0, frequency=frequency, damping=ConstantDamping(ratio=0.0))
    vehicle = Vehicle(mass=1e6, inertia=1e8, cg=5.0, thrust=1e7, tanks=(tank,))
    pilot = Autopilot(attitude_gain=0.5, rate_gain=1.0)
    return Phase(name="alone", time=TIME, case=Case(name="alone", vehicle=vehicle, autopilot=pilot))


@pytest.mark.parametrize(("thinned", "stiffened"), [(1.0, 2.0), (0.4, 1.0), (0.5, 3.0)])
def test_energy_over_frequency_is_kept_where_nothing_damps(thinned, stiffened):
    s = TIME / TIME[-1]
    phase = lone_oscillator(0.01 * thinned**s, 2.0 * stiffened**s)
    growth = growth_along(phase, "T", 0.1)
    kept = (thinned * stiffened) ** -0.5  # m w a^2
    assert growth.factor == pytest.approx(kept, rel=2e-4)
    time, peaks = simulate_flight(phase, np.array([0.1])).peaks(0)
    assert peaks[-1] / peaks[0] == pytest.approx(kept ** ((time[-1] - time[0]) / 120.0), rel=2e-3)


def test_a_flight_that_stands_still_grows_as_the_growth_curve_says(upper_stage):
    phase = Phase(name="still", time=np.linspace(0.0, 60.0, 4), case=upper_stage)
    growth = growth_along(phase, 0, 0.02)
    assert np.max(np.abs(growth.adiabatic)) < 1e-12
    curve = growth_curve(upper_stage)
    assert curve.time_between(0.02, float(growth.amplitude[-1])) == pytest.approx(60.0, rel=1e-4)


def test_the_amplitude_ends_at_the_limit_cycle_of_a_flight_that_stands_still(upper_stage):
    phase = Phase(name="still", time=np.linspace(0.0, 400.0, 3), case=upper_stage)
    assert growth_along(phase, 0, 0.05).amplitude[-1] == pytest.approx(
        limit_cycles(upper_stage)[0].slosh_amplitude["LOX"], rel=1e-5
    )


def test_a_simulation_that_stands_still_is_the_simulation_of_the_case(upper_stage):
    late = upper_stage.model_copy(update={"autopilot": upper_stage.autopilot.model_copy(update={"delay": 0.03})})
    phase = Phase(name="still", time=np.array([0.0, 7.0, 30.0]), case=late)
    here, there = simulate_flight(phase, np.array([0.05]), step=0.01), simulate(late, 30.0, 0.05)
    slosh, tvc = (CubicSpline(here.time, x)(there.time) for x in (here.slosh[:, 0], here.tvc))
    inside = there.time > 0.1  # the delay's first value is a step
    assert slosh[inside] == pytest.approx(there.slosh[inside, 0], abs=1e-6)
    assert tvc[inside] == pytest.approx(there.tvc[inside], abs=1e-6)


def test_the_simulation_of_a_burn_is_that_of_its_equations_written_out(upper_stage):
    time = np.linspace(0.0, 40.0, 401)  # close: the simulation takes the loop, not each number, linear between them
    phase = burning(upper_stage, time)
    found = simulate_flight(phase, np.array([0.2]), step=0.02)

    def motion(t, y):
        s = t / 40.0
        phi, z, rate, v = y
        M, I, X, F = 16e3 * (1.0 - 0.4 * s), 9e5 * (1.0 - 0.2 * s), 6.0 + 0.3 * s, 9e5 * (1.0 + 0.05 * s)
        m, w, l = 1e3 * (1.0 - 0.4 * s), 2.0 * np.sqrt(1.0 + 0.8 * s), X - 9.0 + s
        dm, a = -1e3 * 0.4 / 40.0, F / M
        beta = 0.08 * (1.0 - 0.2 * s) * phi + 0.14 * rate
        b = 0.75 * np.pi * 0.1  # eq 19
        # unknown Z'', phi'' and z''; (m z')' = m z'' + m' z' in every row, eqs 1-3
        rows = np.array([[M, 0.0, m], [0.0, I, -m * l], [1.0, -l, 1.0]])
        right = [
            F * beta + M * a * phi - dm * v,
            -F * X * beta + m * a * z + dm * l * v,
            a * phi - w**2 * z - b * abs(v) * v - dm / m * v,
        ]
        _, turn, swing = np.linalg.solve(rows, right)
        return [rate, v, turn, swing]

    wanted = solve_ivp(motion, (0.0, 40.0), [0.0, 0.2, 0.0, 0.0], rtol=1e-9, atol=1e-12, t_eval=found.time[:-1])
    assert wanted.success
    size = np.max(np.abs(wanted.y[1]))
    assert np.max(np.abs(found.slosh[:-1, 0] - wanted.y[1])) < 2e-4 * size


def test_growth_along_a_burn_agrees_with_its_nonlinear_simulation(upper_stage):
    phase = burning(upper_stage, TIME)
    growth = growth_along(phase, "LOX", 0.05)
    check = check_growth(growth)
    assert len(check.time) > 60
    assert check.worst < 5e-3
    assert f"they differ by {100.0 * check.worst:.3g} % at most" in str(check)
    far = replace(check, simulated=8.21 * check.predicted)
    assert "they differ by 7.21 times the predicted amplitude at most" in str(far)
    # without the term of the changing vehicle it would not
    change = np.exp(np.interp(check.time, growth.time, np.cumsum(growth.adiabatic) * np.diff(growth.time)[0]))
    assert np.max(np.abs(check.simulated / (check.predicted / change) - 1.0)) > 0.02
    assert "differ by" in str(check)


def two_tanks(folder, second):
    """Return a phase of the shipped stage of two tanks, the second one's frequency moved, both changing."""
    case = read_case(write_example("two_tanks", folder))
    v, s = case.vehicle, np.linspace(0.0, 1.0, 61)
    frequency = (2.0 * (1.0 + 0.3 * s), second * (1.0 + 0.6 * s))
    tanks = tuple(t.model_copy(update={"frequency": w}) for t, w in zip(v.tanks, frequency, strict=True))
    body = v.model_copy(update={"mass": v.mass * (1.0 - 0.2 * s), "tanks": tanks})
    return Phase(name="two", time=60.0 * s, case=case.model_copy(update={"vehicle": body}))


def test_an_actuator_a_delay_and_two_tanks_agree_too(tmp_path):
    growth = growth_along(two_tanks(tmp_path, 3.0), "LOX", 0.02)
    assert np.max(growth.mixing) < 0.1
    assert check_growth(growth).worst < 0.02


def test_modes_that_lie_too_near_for_the_change_are_flagged(tmp_path):
    growth = growth_along(two_tanks(tmp_path, 2.1), "LOX", 0.02)
    assert "caution" in str(growth)
    assert check_growth(growth).worst > 0.1  # so that the caution is due


def test_the_mode_alone_swings_from_its_own_state(upper_stage):
    phase = Phase(name="still", time=np.linspace(0.0, 30.0, 3), case=upper_stage)
    growth = growth_along(phase, 0, 1e-6)
    _, peaks = simulate_flight(phase, mode_state(growth)).peaks(0)
    grown = np.diff(np.log(peaks))
    assert np.ptp(grown) < 5e-5  # one mode: every half swing grows by the same factor, peaks to a parabola
    assert np.mean(grown) == pytest.approx(0.05113 * np.pi / 2.13421, rel=1e-3)


def test_what_is_not_supported_is_refused(upper_stage):
    phase = Phase(name="still", time=np.array([0.0, 10.0]), case=upper_stage)
    with pytest.raises(OutsideValidity, match="outside phase still"):
        growth_along(phase, 0, 0.01, end=11.0)
    with pytest.raises(ValueError, match="amplitude > 0"):
        growth_along(phase, 0, 0.0)
    law = TableDamping(amplitude=np.array([0.0, 0.02]), ratio=np.array([0.0, 0.001]))
    ended = burning(upper_stage, TIME, law)
    with pytest.raises(OutsideValidity, match="lost at"):
        growth_along(ended, 0, 0.015)
    late = upper_stage.autopilot.model_copy(update={"delay": np.array([0.0, 0.1])})
    with pytest.raises(OutsideValidity, match="0 s at some times"):
        simulate_flight(
            Phase(name="x", time=np.array([0.0, 1.0]), case=upper_stage.model_copy(update={"autopilot": late})),
            np.array([0.1]),
        )


def test_laws_of_each_time_count(upper_stage):
    laws = tuple((PowerDamping(slope=slope),) for slope in (0.1, 0.4))
    phase = Phase(name="x", time=np.array([0.0, 40.0]), case=upper_stage, laws=laws)
    growth = growth_along(phase, 0, 0.1)
    alone = [growth_curve(case, 0, np.array([float(growth.amplitude[-1])])) for case in phase.cases]
    assert growth.growth[-1] == pytest.approx(float(alone[1].growth[0]), rel=1e-9)
    assert growth.growth[-1] < float(alone[0].growth[0])
    assert check_growth(growth).worst < 5e-3
