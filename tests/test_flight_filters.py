"""Filters and actuator by schedule within a phase: against cases written out, SciPy, the fixed filter, and refusals."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sloshpy.assess import assess
from sloshpy.autopilot import Actuator, Filter
from sloshpy.autopilot.blocks import filter_block
from sloshpy.batch import for_each
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.poles import closed_loop_eigenvalues
from sloshpy.dynamics.response import transfer
from sloshpy.errors import InputError
from sloshpy.files import read_case, read_flight, write_example
from sloshpy.flight import Phase, Trajectory, assess_flight, check_growth, growth_across, growth_along, simulate_flight
from sloshpy.report.flight_tables import phase_inputs
from sloshpy.stability import danger_zone, margins, required_damping
from sloshpy.stability.danger_zone import phase_lead

# what the schedules move stands between braces
STAGE = """
name = "Stage"
[vehicle]
mass = "16 t"
inertia = "9e5 kg*m^2"
cg = "6 m"
thrust = "900 kN"
[[tank]]
name = "LOX"
slosh_mass = "1000 kg"
station = "9 m"
frequency = "2 rad/s"
radius = "3 m"
damping = {{ law = "power", slope = "0.1 1/m", exponent = 1 }}
[[flexible_mode]]
name = "first bending"
frequency = "2.1 Hz"
damping = 0.005
generalized_mass = "9000 kg"
gimbal = {{ deflection = 1.0, slope = "-0.08 1/m" }}
gyro = {{ slope = "0.05 1/m" }}
tank.LOX = {{ deflection = -0.3, slope = "0.02 1/m" }}
[autopilot]
attitude_gain = 0.08
rate_gain = "0.14 s"
delay = "20 ms"
actuator = {{ frequency = "{actuator} Hz", damping = {ratio} }}
[[autopilot.filter]]
numerator = [1.0]
denominator = [{lag}, 1.0]
[[autopilot.filter]]
numerator = [1.0, {narrow}, {square}]
denominator = [1.0, {wide}, {square}]
[[autopilot.filter]]
numerator = [{lead}, 2.0]
denominator = [0.1, 2.0]
"""
TABLE = """t [s],tau,f [Hz],lead,fa [Hz],za
0,0.02,2.1,0.4,6,0.7
10,0.05,2.3,0.5,5.5,0.8
20,0.08,2.6,0.7,5,0.6
"""
FLIGHT = """
name = "Filters by schedule"
[[table]]
name = "pilot"
file = "pilot.csv"
interpolation = "linear"
time = "t"
[table.columns]
"autopilot.filter.1.denominator.s^1" = "tau"
"autopilot.filter.2.frequency" = "f"
"autopilot.filter.3.numerator.s^1" = "lead"
"autopilot.actuator.frequency" = "fa"
"autopilot.actuator.damping" = "za"
[[phase]]
name = "burn"
case = "stage.toml"
start = "0 s"
end = "20 s"
step = "5 s"
tables = ["pilot"]
"""
ROWS = np.array([[float(x) for x in row.split(",")] for row in TABLE.splitlines()[1:]])
TURN = 2.0 * np.pi


def written(lag, notch, lead, actuator, ratio):
    """Return the text of a case at one time; notch, Hz: 0.05 and 0.5 of damping."""
    w = TURN * notch
    return STAGE.format(
        lag=repr(lag), narrow=repr(0.1 * w), wide=repr(w), square=repr(w * w), lead=lead, actuator=actuator, ratio=ratio
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "stage.toml").write_text(written(0.03, 2.4, 0.3, 7.0, 0.9))
    (tmp_path / "pilot.csv").write_text(TABLE)
    (tmp_path / "flight.toml").write_text(FLIGHT)
    return tmp_path


def test_each_time_is_assessed_as_the_case_written_out_with_its_filters(folder):
    flight = read_flight(folder / "flight.toml")
    found = assess_flight(flight, cycles=4).reviews[0]
    assert found.phase.time == pytest.approx([0.0, 5.0, 10.0, 15.0, 20.0])
    for k, t in enumerate(found.phase.time):
        tau, f, lead, fa, za = (float(np.interp(t, ROWS[:, 0], x)) for x in ROWS[:, 1:].T)
        (folder / "alone.toml").write_text(written(tau, f, lead, fa, za))
        case = read_case(folder / "alone.toml")
        alone = margins(case)
        assert found.margins.growth[k] == pytest.approx(float(alone.growth), rel=1e-9)
        assert found.disc_margin[k, 0] == pytest.approx(float(alone.slosh_disc_margin(0)[0]), rel=1e-7)
        assert found.margins.nichols_disc_margin[k] == pytest.approx(float(alone.nichols_disc_margin), rel=1e-7)
        assert found.witness[k] == alone.witness
        assert found.required_damping[k, 0] == pytest.approx(float(required_damping(case).required), rel=1e-7)
        assert found.zones[0].lead[k] == pytest.approx(danger_zone(case).lead, rel=1e-10)
        if k in {0, 4}:
            whole, cycle = assess(case), found.assessments[k]
            assert cycle.verdict == whole.verdict
            assert cycle.worst_tvc_amplitude == pytest.approx(whole.worst_tvc_amplitude, rel=1e-7)


def test_a_batch_of_filters_and_actuators_is_the_loop_over_them(folder):
    case = read_flight(folder / "flight.toml").phases[0].case
    loop, s = open_loop(case), 1j * np.geomspace(0.1, 60.0, 7)
    whole = transfer(loop.along(), s).loop
    assert loop.batch == (5,)
    poles = closed_loop_eigenvalues(loop)
    picked = transfer(loop.take(np.array([3, 1])), s[:2]).loop
    for k, one in enumerate(for_each(lambda one: one, case)):
        alone = open_loop(one)
        assert transfer(alone, s).loop == pytest.approx(whole[k], rel=1e-13)
        assert np.sort_complex(closed_loop_eigenvalues(alone)) == pytest.approx(
            np.sort_complex(poles[k]), rel=1e-10, nan_ok=True
        )
        assert phase_lead(one.autopilot, 2.0) == pytest.approx(phase_lead(case.autopilot, 2.0)[k], rel=1e-13)
    assert picked == pytest.approx([whole[3, 0], whole[1, 1]], rel=1e-13)


def test_a_filters_frequency_moves_all_its_poles_and_zeros(folder):
    fixed = read_case(folder / "stage.toml").autopilot.filter[1]
    moved = read_flight(folder / "flight.toml").phases[0].cases[4].autopilot.filter[1]
    for part in ("numerator", "denominator"):
        old, new = np.roots(getattr(fixed, part)), np.roots(getattr(moved, part))
        assert new == pytest.approx(old * 2.6 / 2.4, rel=1e-12)
    # and its realisation is the same filter on a clock that runs faster
    a, b = filter_block(fixed), filter_block(moved)
    np.testing.assert_allclose(b.A, a.A * 2.6 / 2.4, rtol=1e-12)
    np.testing.assert_allclose(b.B, a.B * 2.6 / 2.4, rtol=1e-12)
    np.testing.assert_allclose(b.C, a.C, rtol=1e-12)
    assert (float(a.D), float(b.D)) == pytest.approx((1.0, 1.0))


@pytest.fixture(scope="module")
def upper_stage(tmp_path_factory):
    return read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))


def piloted(case, time, **pilot):
    autopilot = case.autopilot.model_copy(update=pilot)
    return Phase(name="burn", time=time, case=case.model_copy(update={"autopilot": autopilot}))


def plant(case):
    """Return what the paper's stage does: x = [phi, z, phi', z'] and the engine angle to [phi'', z'']."""
    M, I, X, F, m, w, l = 16e3, 9e5, 6.0, 9e5, 1e3, 2.0, -3.0
    v, tank = case.vehicle, case.vehicle.tanks[0]
    assert (v.mass, v.inertia, v.cg, v.thrust) == pytest.approx((M, I, X, F), rel=2e-2)
    M, I, F = float(v.mass), float(v.inertia), float(v.thrust)
    assert (tank.slosh_mass, tank.frequency, tank.station) == (m, w, X - l)
    rows, b, a = np.array([[M, 0.0, m], [0.0, I, -m * l], [1.0, -l, 1.0]]), 0.75 * np.pi * 0.1, F / M

    def motion(phi, z, v, beta):
        right = [F * beta + F * phi, -F * X * beta + m * a * z, a * phi - w**2 * z - b * abs(v) * v]
        return np.linalg.solve(rows, right)[1:]

    return motion


def test_a_scheduled_lag_is_that_of_its_equation_written_out(upper_stage):
    time = np.linspace(0.0, 30.0, 601)  # close: the simulation takes the loop, not each number, linear between them
    tau = 0.05 + 0.6 * time / 30.0
    lag = Filter.model_construct(numerator=(1.0,), denominator=(tau, 1.0))
    found = simulate_flight(piloted(upper_stage, time, filter=(lag,)), np.array([0.2]), step=0.02)
    motion = plant(upper_stage)

    def slope(t, x):
        phi, z, rate, v, beta = x
        turn, swing = motion(phi, z, v, beta)
        return [rate, v, turn, swing, (0.08 * phi + 0.14 * rate - beta) / (0.05 + 0.6 * t / 30.0)]

    wanted = solve_ivp(slope, (0.0, 30.0), [0.0, 0.2, 0.0, 0.0, 0.0], "LSODA", found.time, rtol=1e-9, atol=1e-12)
    assert wanted.success
    slosh, engine = wanted.y[1], wanted.y[4]
    assert np.max(np.abs(found.slosh[:, 0] - slosh)) < 2e-4 * np.max(np.abs(slosh))
    assert np.max(np.abs(found.tvc - engine)) < 2e-4 * np.max(np.abs(engine))
    # another realisation of the same lag is another filter: tau y' = u - y (1 + tau'), by 2 % here
    assert np.max(np.abs(engine)) > 1e-3


def test_a_scheduled_notch_and_actuator_are_those_of_their_equations_written_out(upper_stage):
    time = np.linspace(0.0, 30.0, 1201)
    w, wa = 3.0 + 4.0 * time / 30.0, 20.0 - 8.0 * time / 30.0
    notch = Filter.model_construct(numerator=(1.0, 0.2 * w, w**2), denominator=(1.0, 1.2 * w, w**2))
    actuator = Actuator.model_construct(frequency=wa, damping=0.7 + 0.01 * time)
    phase = piloted(upper_stage, time, filter=(notch,), actuator=actuator)
    found = simulate_flight(phase, np.array([0.2]), step=0.01)
    motion = plant(upper_stage)

    def slope(t, x):
        phi, z, rate, v, p, q, beta, turned = x
        own, a, zeta = 3.0 + 4.0 * t / 30.0, 20.0 - 8.0 * t / 30.0, 0.7 + 0.01 * t
        u = 0.08 * phi + 0.14 * rate
        y = u - 1.0 * p  # two integrators at w(t), each by it: p' = w (u - 1.2 p - q), q' = w p
        turn, swing = motion(phi, z, v, beta)
        return [
            rate, v, turn, swing,
            own * (u - 1.2 * p - q), own * p,
            turned, a * a * (y - beta) - 2.0 * zeta * a * turned,
        ]  # fmt: skip

    start = [0.0, 0.2, *6 * [0.0]]
    wanted = solve_ivp(slope, (0.0, 30.0), start, "LSODA", found.time, rtol=1e-9, atol=1e-12)
    assert wanted.success
    assert np.max(np.abs(found.slosh[:, 0] - wanted.y[1])) < 2e-4 * np.max(np.abs(wanted.y[1]))
    assert np.max(np.abs(found.tvc - wanted.y[6])) < 2e-4 * np.max(np.abs(wanted.y[6]))


def test_growth_along_moving_filters_agrees_with_its_simulation(upper_stage):
    time = np.linspace(0.0, 60.0, 61)
    w, tau = 2.5 + 2.0 * time / 60.0, 0.02 + 0.3 * time / 60.0
    notch = Filter.model_construct(numerator=(1.0, 0.4 * w, w**2), denominator=(1.0, 1.2 * w, w**2))
    lag = Filter.model_construct(numerator=(1.0,), denominator=(tau, 1.0))
    actuator = Actuator.model_construct(frequency=25.0 - 15.0 * time / 60.0, damping=np.full(61, 0.7))
    check = check_growth(
        growth_along(piloted(upper_stage, time, filter=(notch, lag), actuator=actuator, delay=0.02), "LOX", 0.05)
    )
    assert len(check.time) > 30
    assert check.worst < 5e-3
    growth = check.growth.parts[0]
    # and would not without what the moving filters and actuator do by themselves
    assert np.exp(np.trapezoid(growth.adiabatic, growth.time)) - 1.0 > 0.01


def test_a_simulation_in_two_phases_of_one_schedule_is_that_in_one(upper_stage):
    def flown(begin, end):
        time = np.linspace(begin, end, round((end - begin) / 0.5) + 1)
        tau = 0.05 + 0.01 * time
        lag = Filter.model_construct(numerator=(1.0, 2.0), denominator=(tau, 2.0))
        return Phase(name=f"from {begin:g}", time=time, case=piloted(upper_stage, time, filter=(lag,)).case)

    whole = simulate_flight(flown(0.0, 20.0), np.array([0.1]), step=0.01)
    parts = simulate_flight([flown(0.0, 8.0), flown(8.0, 20.0)], np.array([0.1]), step=0.01)
    assert parts.time == pytest.approx(whole.time, abs=1e-9)
    assert parts.slosh == pytest.approx(whole.slosh, abs=1e-9)


def test_a_schedule_that_stands_still_is_none(folder):
    rows = "\n".join(f"{t},0.03,2.4,0.3,7,0.9" for t in (0, 10, 20))
    (folder / "pilot.csv").write_text(TABLE.splitlines()[0] + "\n" + rows)
    moving = read_flight(folder / "flight.toml").phases[0]
    still = Phase(name="burn", time=moving.time, case=read_case(folder / "stage.toml"))
    for one, other in zip(moving.cases, still.cases, strict=True):
        p, q = one.autopilot, other.autopilot
        for a, b in zip((*p.filter, p.actuator), (*q.filter, q.actuator), strict=True):
            assert a.fraction[0] == pytest.approx(b.fraction[0], rel=1e-15)
            assert a.fraction[1] == pytest.approx(b.fraction[1], rel=1e-15)
    here, there = (assess_flight(Trajectory(name="x", phases=(x,)), cycles=0).reviews[0] for x in (moving, still))
    assert here.margins.growth == pytest.approx(there.margins.growth, rel=1e-9)
    assert here.disc_margin == pytest.approx(there.disc_margin, rel=1e-8)
    one, other = (growth_along(x, 0, 0.05) for x in (moving, still))
    assert one.amplitude == pytest.approx(other.amplitude, rel=1e-9)
    a, b = (simulate_flight(x, np.array([0.05])) for x in (moving, still))
    assert a.slosh == pytest.approx(b.slosh, abs=1e-9)


def test_the_report_lists_each_moving_coefficient_with_its_table(folder):
    rows = {row[0]: row for row in phase_inputs(read_flight(folder / "flight.toml").phases[0]).rows}
    assert rows["autopilot.filter.1.denominator"][3:] == ("s^1: 0.02 to 0.08; s^0: 1", 'table "pilot"')
    assert rows["autopilot.filter.1.numerator"][3:] == ("1", "case")
    assert rows["autopilot.filter.2.numerator"][4] == 'table "pilot"'
    assert rows["autopilot.filter.2.denominator"][3].startswith("s^2: 1; s^1: 13.1947 to 16.3363; s^0: 174.")
    assert rows["autopilot.actuator.frequency"][4] == 'table "pilot"'


SAYS = '"autopilot.filter.1.denominator.s^1"'


@pytest.mark.parametrize(
    ("file", "old", "new", "line", "rule"),
    [
        ("flight.toml", SAYS, '"autopilot.filter.4.denominator.s^1"', 9, "names no filter of the case, which has 1, 2"),
        ("flight.toml", SAYS, '"autopilot.filter.1"', 9, "names no coefficient"),
        ("flight.toml", SAYS, '"autopilot.filter.1.denominator.1"', 9, "names no coefficient"),
        ("flight.toml", SAYS, '"autopilot.filter.1.numerator.s^1"', 9, "is beyond the case's numerator, which ends at"),
        ("flight.toml", SAYS, '"autopilot.digital_filter.1.denominator"', 9, '"digital_filter" follows no schedule'),
        ("flight.toml", SAYS, '"autopilot.actuator.rate_limit"', 9, '"rate_limit" of an actuator follows no schedule'),
        ("flight.toml", SAYS, '"autopilot.actuator.denominator.s^1"', 9, "names nothing of this actuator"),
        ("flight.toml", SAYS, '"autopilot.filter.2.denominator.s^1"', 14, "stands beside another schedule of the same"),
        ("pilot.csv", "10,0.05", "10,-0.05", 3, "denominator: its first coefficient, of s^1, passes through 0"),
        ("pilot.csv", "10,0.05", "10,nan", 3, "must be finite"),
        ("pilot.csv", "2.3,0.5", "2.3,-0.5", 3, "numerator: its first coefficient, of s^1, passes through 0"),
        ("pilot.csv", "10,0.05,2.3", "10,0.05,-2.3", 3, "must be > 0 rad/s"),
        ("pilot.csv", "5.5,0.8", "5.5,-0.8", 3, "must be > 0"),
        ("pilot.csv", "tau", "tau [s]", 1, "is a time, must be a plain number"),
    ],
)  # fmt: skip
def test_what_makes_no_filter_is_refused(folder, file, old, new, line, rule):
    problems = spoilt(folder, file, old, new)
    told = [problem for problem in problems if rule in problem.rule]
    assert told, [str(problem) for problem in problems]
    assert told[0].line == line, str(told[0])
    assert told[0].cure


def test_a_unit_that_is_wrong_or_missing_is_cured_in_its_own_kind(folder):
    (problem,) = spoilt(folder, "pilot.csv", "tau", "tau [s]")
    assert problem.cure.startswith("leave the unit out")
    (folder / "pilot.csv").write_text(TABLE)
    for problem in spoilt(folder, "pilot.csv", "f [Hz]", "f"):
        assert problem.cure.startswith('write "f [rad/s]" in the header')


def test_a_pole_that_reaches_the_origin_is_refused(folder):
    moved = FLIGHT.replace("denominator.s^1", "denominator.s^0")
    (folder / "flight.toml").write_text(moved)
    (folder / "pilot.csv").write_text(TABLE.replace("20,0.08", "20,0"))
    with pytest.raises(InputError, match="has a pole that reaches or leaves the origin") as caught:
        read_flight(folder / "flight.toml")
    assert caught.value.problems[0].line == 4
    # one that stays there is an integrator whose gain moves
    rows = TABLE.replace("0,0.02", "0,0").replace("10,0.05", "10,0").replace("20,0.08", "20,0")
    (folder / "pilot.csv").write_text(rows)
    assert read_flight(folder / "flight.toml").phases[0].cases[2].autopilot.filter[0].denominator == (0.03, 0.0)


def spoilt(folder, file, old, new):
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_flight(folder / "flight.toml")
    return caught.value.problems


def test_a_filter_that_is_unstable_between_two_sound_rows_is_refused(folder):
    # s^3 + a s^2 + b s + c is stable where a b > c: in both rows, and not halfway, with 5.05 * 5.05 < 47.5
    case = (folder / "stage.toml").read_text().replace("[0.03, 1.0]", "[1.0, 2.0, 2.0, 1.0]")
    (folder / "stage.toml").write_text(case)
    columns = "".join(f'"autopilot.filter.1.denominator.s^{n}" = "{c}"\n' for n, c in ((2, "a"), (1, "b"), (0, "c")))
    head = FLIGHT.split("[table.columns]")[0]
    phase = FLIGHT.split("[[phase]]")[1].replace('step = "5 s"', 'step = "20 s"')
    (folder / "flight.toml").write_text(f"{head}[table.columns]\n{columns}[[phase]]{phase}")
    (folder / "pilot.csv").write_text("t [s],a,b,c\n0,0.1,0.1,0.005\n20,0.1,10,0.9\n")
    assert len(read_flight(folder / "flight.toml").phases[0].cases) == 2
    (folder / "pilot.csv").write_text("t [s],a,b,c\n0,0.1,0.1,0.005\n20,10,10,95\n")
    with pytest.raises(InputError) as caught:
        read_flight(folder / "flight.toml")
    (problem,) = caught.value.problems
    poles = np.roots([1.0, 5.05, 5.05, 47.5025])
    worst = poles[np.argmax(poles.real)]
    assert problem.rule == (
        f"at 10 s: autopilot.filter.1 denominator: has a pole at {worst.real:.4g} +- {abs(worst.imag):.4g}j rad/s"
    )
    (folder / "pilot.csv").write_text("t [s],a,b,c\n0,0.1,0.1,0.005\n15,0.5,0.5,1\n20,10,10,95\n")
    with pytest.raises(InputError) as caught:
        read_flight(folder / "flight.toml")
    (problem,) = caught.value.problems
    # s^3 + 0.5 s^2 + 0.5 s + 1 = (s + 1)(s^2 - 0.5 s + 1); a row is told before what lies between rows
    assert (problem.key, problem.line) == ("autopilot.filter.1", 3)
    assert problem.rule == "denominator: has a pole at 0.25 +- 0.9682j rad/s"


def test_growth_across_an_event_with_moving_filters_agrees_with_its_simulation(upper_stage):
    def flown(name, begin, end, thrust):
        time = np.linspace(begin, end, round(end - begin) + 1)
        w = 3.0 + time / 40.0
        notch = Filter.model_construct(numerator=(1.0, 0.4 * w, w**2), denominator=(1.0, 1.2 * w, w**2))
        case = piloted(upper_stage, time, filter=(notch,), delay=0.02).case
        vehicle = case.vehicle.model_copy(update={"thrust": thrust, "vectored_thrust": thrust})
        return Phase(name=name, time=time, case=case.model_copy(update={"vehicle": vehicle}))

    phases = (flown("full", 0.0, 30.0, 9e5), flown("half", 30.0, 60.0, 7e5))
    check = check_growth(growth_across(Trajectory(name="throttled", phases=phases), "LOX", 0.05))
    assert len(check.growth.parts) == 2
    assert check.time[-1] > 55.0
    # as where nothing moves (`test_flight_events`): just after the event other modes die out first
    assert check.worst < 1e-2
    assert np.max(np.abs(check.difference[check.time > 45.0])) < 1e-3
    # the same filter on both sides goes on
    assert phases[0].cases[-1].autopilot.filter == phases[1].cases[0].autopilot.filter
