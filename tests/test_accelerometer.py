"""A lateral accelerometer in the loop, against the second implementation, which keeps Z'' as an unknown."""

# ruff: noqa: E501 - one fault is one line of the table
import control
import numpy as np
import pytest
import sympy as sp
from pydantic import ValidationError

import oracle
import oracle_flexible as second
from cases import PAPER_VEHICLE, paper_case, sensed_case, xi
from held import hold_history, hold_poles, hold_zeros
from sloshpy.autopilot import Actuator, Autopilot, Filter
from sloshpy.batch import for_each
from sloshpy.case import Case, Criteria
from sloshpy.damping import PowerDamping
from sloshpy.dynamics import frequency_response, open_loop, plant, without_drift
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.poles import closed_loop_eigenvalues
from sloshpy.dynamics.response import frequency_sensitivity, transfer
from sloshpy.errors import InputError, OutsideValidity
from sloshpy.files import read_case, to_control, write_case
from sloshpy.report.inputs import input_rows
from sloshpy.simulation import simulate
from sloshpy.stability import danger_zone, margins
from sloshpy.stability.danger_zone import departure
from sloshpy.stability.grid import grid_sweep
from sloshpy.vehicle import Engine, Vehicle

SERVO = Actuator(numerator=(1.2e6,), denominator=tuple(np.poly([-60.0, -100.0, -200.0])))


def fleet(seed, count, **parts):
    rng = np.random.default_rng(seed)
    return [sensed_case(rng, **parts) for _ in range(count)]


def stage(law=None, *, gain=0.003, station=7.0, vehicle=None, **pilot):
    """The paper's stage with an accelerometer."""
    here = paper_case(law or xi(0.02), vehicle=vehicle, actuator=Actuator(frequency=30.0, damping=0.7))
    given = {k: getattr(here.vehicle, k) for k in Vehicle.model_fields} | {"accelerometer_station": station}
    gains = {k: getattr(here.autopilot, k) for k in Autopilot.model_fields}
    return Case(
        name="felt", vehicle=Vehicle(**given), autopilot=Autopilot(**gains | {"accelerometer_gain": gain} | pilot)
    )


@pytest.fixture(scope="module")
def many():
    cases = fleet(511, 500)
    assert {len(c.vehicle.tanks) for c, _ in cases} == {1, 2, 3, 4}
    for part in ("engine", "aerodynamics", "flexible_modes"):
        assert 150 < sum(bool(getattr(c.vehicle, part)) for c, _ in cases) < 450
    assert 150 < sum(c.autopilot.delay > 0 for c, _ in cases) < 350
    return [(c, x, second.second_order(c.vehicle, x), open_loop(c, x)) for c, x in cases]


def test_loop_and_slosh_response_of_500_vehicles_are_the_oracles(many):
    for case, _, p, loop in many:
        v = case.vehicle
        own = np.array([t.frequency for t in v.tanks] + [f.frequency for f in v.flexible_modes])
        w = np.concatenate([np.geomspace(0.05, 10, 12) * own[0], own])
        L, z, cancelled = second.solved(p, case.autopilot, 1j * w)
        r = frequency_response(loop, w)
        # beyond 1e3 the oracle's own sum of Z'' and -a phi has cancelled its digits
        allowed = 1e-10 * np.maximum(1.0, cancelled / 1e3)
        assert np.all(np.abs(r.loop - L) < allowed * np.abs(L)), (np.abs(r.loop / L - 1).max(), cancelled.max())
        assert np.all(np.abs(r.slosh - z) < 1e-10 * np.abs(z) + 1e-14 * np.abs(z).max(axis=0))


def test_verdict_count_of_unstable_poles_and_poles_are_the_oracles(many):
    unstable = 0
    for case, _, p, loop in many[:300]:
        values = hold_poles(case, p, loop)
        if not case.autopilot.delay:
            theirs = second.poles(p, case.autopilot)
            assert len(values) == len(theirs)
            for s in theirs:
                # 1e-6: nearly double filter and actuator poles lose half the digits of a double
                assert np.abs(values - s).min() < 1e-6 * max(abs(s), 1e-2)
        unstable += values.real.max() > 0
    assert 60 < unstable < 240


def test_a_rigid_body_that_drifts_under_its_own_thrust_feels_nothing_at_its_cg():
    """Without engine angle Z'' = a phi; with one the accelerometer reads R' beta / M and the percussion of its arm."""
    vehicle = Vehicle(**PAPER_VEHICLE, drag=1e4, accelerometer_station=6.0)
    felt = without_drift(plant(vehicle)).accelerometer
    assert np.array_equal(felt[:, 0], [0.0, 0.0, 0.0])
    assert felt[:, 1].tolist() == [9e5 / 1.6e4, 0.0, 0.0]
    # at the centre of percussion of the gimbal, I/(M Xcg) ahead of the c.g., the engine is not felt
    ahead = vehicle.model_copy(update={"accelerometer_station": 6.0 + 9e5 / (1.6e4 * 6.0)})
    full = without_drift(plant(ahead))
    angle = full.accelerometer[0, -1] + full.accelerometer[2, 0] * full.force[0] / full.mass[0, 0]
    assert angle == pytest.approx(0.0, abs=1e-13)


def test_a_still_pendulum_reading_is_the_tilt_of_the_local_axis():
    """Held still in a field a, the accelerometer reads -a times the slope of the axis where it stands."""
    case, _ = fleet(512, 1, tanks=1, modes=2, engine=False, air=False)[0]
    v = case.vehicle
    rows = plant(v).accelerometer
    a = (v.thrust - v.drag) / v.mass
    assert rows[0, 1] == pytest.approx(-a)
    for i, f in enumerate(v.flexible_modes):
        assert rows[0, 3 + i] == pytest.approx(-a * f.accelerometer.slope)
        assert rows[2, 3 + i] == f.accelerometer.deflection
    assert not rows[:, -1].any()
    assert not rows[1].any()


def test_the_reading_is_the_acceleration_of_the_point_along_its_own_normal():
    """By sympy, in the frame that falls: the body's point accelerates forward by a, the sensor turns with the slope."""
    t, a, X = sp.symbols("t a X")  # X: forward of the c.g.
    u, Z, phi, eta = (sp.Function(name)(t) for name in ("u", "Z", "phi", "eta"))
    Y, dY = sp.symbols("Y dY")
    r = sp.Matrix([u + X * sp.cos(phi) - Y * eta * sp.sin(phi), Z + X * sp.sin(phi) + Y * eta * sp.cos(phi)])
    normal = sp.Matrix([-sp.sin(phi + dY * eta), sp.cos(phi + dY * eta)])
    reading = r.diff(t, 2).dot(normal)
    names, swap = {}, [(u.diff(t, 2), a)]
    for order in (2, 1, 0):
        for x in (Z, phi, eta):
            names[x.func, order] = sp.Symbol(f"{x.func}_{order}")
            swap.append((x.diff(t, order) if order else x, names[x.func, order]))
    reading = reading.subs(swap)
    rest = dict.fromkeys(names.values(), 0)
    assert reading.subs(rest) == 0
    row = {key: reading.diff(name).subs(rest) for key, name in names.items()}
    case, _ = fleet(512, 1, tanks=1, modes=1, engine=False, air=False)[0]
    v, shape = case.vehicle, case.vehicle.flexible_modes[0].accelerometer
    at = {a: v.acceleration, X: v.accelerometer_station - v.cg, Y: shape.deflection, dY: shape.slope}
    rows = plant(v).accelerometer
    for order in (0, 1, 2):
        for x, column in ((Z, 0), (phi, 1), (eta, 3)):
            assert rows[order, column] == pytest.approx(float(row[x.func, order].subs(at)), rel=1e-14, abs=1e-14)
        assert rows[order, 2] == rows[order, 4] == 0.0


def test_without_a_gain_nothing_changes():
    plain = paper_case(xi(0.02), actuator=Actuator(frequency=30.0, damping=0.7))
    w = np.geomspace(0.1, 20, 50)
    silent = stage(gain=0.003).model_copy(update={"autopilot": plain.autopilot})
    for case in (silent, plain):
        assert np.array_equal(frequency_response(open_loop(case), w).loop, frequency_response(open_loop(plain), w).loop)
    assert (
        np.abs(frequency_response(open_loop(stage()), w).loop / frequency_response(open_loop(plain), w).loop - 1).max()
        > 0.05
    )


# ---------------------------------------------------------------- margins, shares, grids, zeros


def test_every_minimum_on_a_dense_grid_is_listed():
    for case, damping in fleet(513, 25):
        p = second.second_order(case.vehicle, damping)
        found = margins(case, damping=damping)
        assert found.trusted
        size = np.abs(second.poles(p, case.autopilot.model_copy(update={"delay": 0.0})))
        w = np.geomspace(0.1 * min(t.frequency for t in case.vehicle.tanks), 3 * size.max(), 20001)
        L = np.concatenate([second.solved(p, case.autopilot, 1j * part)[0] for part in np.array_split(w, 20)])
        dm = oracle.disc_margin(L)
        ours, value = found.minima.omega, found.minima.value
        ours, value = ours[np.isfinite(ours)], value[np.isfinite(ours)]
        assert value.min(initial=4.0) <= dm.min() * (1 + 1e-6)
        for k in np.flatnonzero((dm[1:-1] < dm[:-2]) & (dm[1:-1] < dm[2:]) & (dm[1:-1] < 4)) + 1:
            close = (ours > w[k - 1] * (1 - 1e-9)) & (ours < w[k + 1] * (1 + 1e-9))
            assert np.any(close & (value <= dm[k] * (1 + 1e-9))), (w[k], dm[k])
        share = found.minima.share[np.isfinite(found.minima.omega)]
        np.testing.assert_allclose(share.sum(axis=-1), 1.0, rtol=1e-12)


def test_the_sensitivity_to_each_modes_frequency_is_its_finite_difference():
    for case, damping in fleet(514, 12, tanks=2, modes=1):
        v = case.vehicle
        s = 1j * np.geomspace(0.3, 5, 9) * v.tanks[0].frequency
        found = frequency_sensitivity(open_loop(case, damping), s)
        h = 1e-5

        def at(which, factor, case=case, damping=damping, s=s):
            v = case.vehicle
            nouns = [*v.tanks, *v.flexible_modes]
            nouns[which] = nouns[which].model_copy(update={"frequency": nouns[which].frequency * factor})
            changed = v.model_copy(update={"tanks": tuple(nouns[:2]), "flexible_modes": tuple(nouns[2:])})
            return second.solved(second.second_order(changed, damping), case.autopilot, s)[0]

        L = second.solved(second.second_order(v, damping), case.autopilot, s)[0]
        for g in range(3):
            numeric = (at(g, 1 + h) - at(g, 1 - h)) / (2 * h)
            # 1e-6: a central difference of step 1e-5 loses the eleventh digit of L to rounding
            assert np.all(np.abs(found[:, g] - numeric) < 1e-6 * np.abs(numeric) + 1e-7 * np.abs(L))


def test_the_shares_say_how_the_neutral_frequency_moves():
    """Degrade to neutral, raise the tank's frequency by 1e-4, degrade again: the frequency follows by the share."""
    case = stage(xi(0.02), gain=-0.002)
    found = margins(case)
    omega, share = found.minima.omega[0], found.minima.share[0]
    w = case.vehicle.tanks[0].frequency

    def neutral(frequency):
        tank = case.vehicle.tanks[0].model_copy(update={"frequency": frequency})
        there = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": (tank,)})})
        loop = open_loop(there, 0.02 * w / frequency)  # the same damping in 1/s: the share moves frequency and rate
        L0 = transfer(open_loop(case), np.asarray(1j * omega)).loop
        s = 1j * omega
        for _ in range(20):  # L(s) = L(j omega) as it was: the degradation k = -1/L stays
            f = transfer(loop, np.asarray(s)).loop - L0
            df = (transfer(loop, np.asarray(s * (1 + 1e-6))).loop - transfer(loop, np.asarray(s * (1 - 1e-6))).loop) / (
                2e-6 * s
            )
            s = s - f / df
        return s

    h = 1e-4
    moved = (neutral(w * (1 + h)).imag - neutral(w * (1 - h)).imag) / (2 * h * omega)
    dissipation = share[0]
    assert abs(share.sum() - 1) < 1e-12
    # frequency_sensitivity scales w at fixed damping ratio; at fixed 2 xi w the difference is that of xi
    loop_ratio = (
        frequency_response(open_loop(case, 0.02 * (1 + h)), np.array([omega])).loop
        - frequency_response(open_loop(case, 0.02 * (1 - h)), np.array([omega])).loop
    ) / (2 * h)
    one = open_loop(case)
    s = 1j * omega
    slope = (transfer(one, np.asarray(s * (1 + 1e-7))).loop - transfer(one, np.asarray(s * (1 - 1e-7))).loop) / 2e-7
    assert moved == pytest.approx(dissipation + float((loop_ratio[0] / slope).real), rel=1e-5, abs=1e-6)


def test_a_grid_of_one_rigid_tank_takes_the_accelerometer():
    omega, dampings = np.geomspace(0.2, 12.0, 300), np.array([0.003, 0.03, 0.1])
    masses = np.array([[14000.0], [16000.0]])
    found = grid_sweep(open_loop(stage(vehicle={"mass": masses}), dampings[:, None]), omega, Criteria())
    for i, j in np.ndindex(2, 3):
        case = stage(vehicle={"mass": float(masses[i, 0])})
        p = second.second_order(case.vehicle, [dampings[j]])
        L, z, _ = second.solved(p, case.autopilot, 1j * omega)
        assert found.least[i, j] == pytest.approx(oracle.disc_margin(L).min(), rel=1e-9)
        assert found.slosh[i, j] == pytest.approx(np.abs(z).max(), rel=1e-9)
        assert found.stable[i, j] == second.stable(p, case.autopilot)


def test_the_zeros_of_the_loop_are_the_oracles():
    for engine in (False, True):
        hold_zeros(fleet(515, 15, engine=engine, delay=False))


def test_the_departure_is_the_shift_of_the_pole_at_small_gain():
    for case, _ in fleet(516, 8, tanks=2, delay=False):
        loop = open_loop(case, 0.0)
        found = departure(loop, 0)
        small = case.autopilot.model_copy(update={"gain": 1e-6})
        p = second.second_order(case.vehicle, [0.0, 0.0])
        w = case.vehicle.tanks[0].frequency
        start = second.poles(p, case.autopilot.model_copy(update={"gain": 1e-12}))
        end = second.poles(p, small)
        pole = start[np.argmin(np.abs(start - found_pole(loop, w)))]
        moved = end[np.argmin(np.abs(end - pole))] - pole
        assert moved.real / (1e-6 / case.autopilot.gain) == pytest.approx(float(found), rel=1e-3, abs=1e-5)


def found_pole(loop, w):
    """The plant's slosh pole of tank 0: the one of which the slosh coordinate is the greatest part."""
    from sloshpy.dynamics import open_loop_poles

    poles = open_loop_poles(loop)
    return poles.value[poles.tank.index(loop.plant.tanks[0])]


def test_the_closed_form_of_the_danger_zone_is_refused():
    zone = danger_zone(stage())
    assert zone.inside is None
    assert "accelerometer" in zone.reason
    assert "nan" not in str(zone)
    assert danger_zone(stage(gain=np.array([0.001, 0.002]))).within.tolist() == pytest.approx([np.nan] * 2, nan_ok=True)


# ---------------------------------------------------------------- time domain, exchange


@pytest.mark.parametrize("seed", [517, 518, 519])
def test_time_histories_agree_with_dop853(seed):
    """Also where the filters pass a step at once and the damping force is felt by the command itself."""
    rng = np.random.default_rng(seed)
    while True:
        case, damping = sensed_case(rng, tanks=2, modes=1, engine=seed != 518, air=seed == 519, delay=False)
        if seed == 518:
            actuator = Actuator(numerator=(50.0,), denominator=(1.0, 50.0))
            lead = Filter(numerator=(1.0, 3.0), denominator=(1.0, 9.0))
            pilot = case.autopilot.model_copy(update={"actuator": actuator, "filter": (lead,)})
            case = case.model_copy(update={"autopilot": pilot})
        p = second.second_order(case.vehicle, damping)
        if second.poles(p, case.autopilot).real.max() < 0.05:
            break
    hold_history(rng, case, damping, duration=10)


@pytest.mark.parametrize("lags", ["filter", "actuator"])
def test_a_delayed_history_grows_as_the_pole_says(lags):
    """A linear history with a true delay line grows by the exact pole, whichever side of the delay the lag is on."""
    pilot = {"delay": 0.12}
    if lags == "actuator":  # the filter passes at once: the command that is delayed holds what is felt now
        pilot |= {"actuator": SERVO, "filter": (Filter(numerator=(1.0, 4.0), denominator=(1.0, 6.0)),)}
    else:
        pilot |= {"actuator": None, "filter": (Filter(numerator=(20.0,), denominator=(1.0, 20.0)),)}
    case = stage(xi(0.001), gain=0.004, **pilot)
    loop = open_loop(case)
    values = closed_loop_eigenvalues(loop)
    values = values[np.isfinite(values)]
    pole = values[np.argmax(values.real)]
    assert pole.real > 0.005
    assert pole.imag > 1.0 or pole.imag < -1.0
    run = simulate(case, duration=80.0, initial_slosh=0.001, damping=0.001, step=0.004)
    z, step = run.slosh[len(run.time) // 2 :, 0], round(0.7 / run.step)
    # one growing sinusoid is left: z[k + 2 m] = c1 z[k + m] + c2 z[k]
    recurrence = np.linalg.lstsq(np.stack([z[step:-step], z[: -2 * step]], axis=1), z[2 * step :], rcond=None)[0]
    roots = np.log(np.roots([1.0, *-recurrence]).astype(complex)) / (step * run.step)
    assert np.abs(roots - pole).min() < 1e-6


@pytest.mark.parametrize("lags", ["filter", "actuator", "both"])
def test_delayed_histories_agree_with_the_method_of_steps(lags):
    pilot = {"delay": 0.12}
    lead, lag = (
        Filter(numerator=(1.0, 4.0), denominator=(1.0, 6.0)),
        Filter(numerator=(20.0,), denominator=(1.0, 20.0)),
    )
    pilot |= {"filter": (lead,) if lags == "actuator" else (lead, lag)}
    pilot |= {"actuator": None if lags == "filter" else SERVO}
    case = stage(PowerDamping(slope=0.3, exponent=1.0), gain=0.004, **pilot)
    if lags == "both":
        case = case.model_copy(
            update={"vehicle": case.vehicle.model_copy(update={"engine": Engine(first_moment=900.0, inertia=1500.0)})}
        )
    run = simulate(case, duration=6.0, initial_slosh=0.2, step=1e-3)
    forces = [lambda x: -(3 * np.pi * 0.3 / 4) * x * abs(x)]
    z, beta, phi = second.history(case.vehicle, case.autopilot, forces, [0.2], run.time)
    for ours, theirs in ((run.slosh, z), (run.tvc, beta), (run.attitude, phi)):
        assert np.abs(ours - theirs).max() < 1e-5 * np.abs(theirs).max()


def test_python_control_gets_the_loop_and_closes_it():
    for case, damping in fleet(520, 8, tanks=2, delay=False):
        p, loop = second.second_order(case.vehicle, damping), open_loop(case, damping)
        w = np.geomspace(0.2, 20, 20)
        L, _, cancelled = second.solved(p, case.autopilot, 1j * w)
        assert np.all(np.abs(to_control(loop)(1j * w) - L) < 1e-7 * np.maximum(1, cancelled / 1e3) * np.abs(L))
        closed = control.feedback(to_control(loop), 1).poles()
        assert closed.real.max() == pytest.approx(float(greatest_growth(loop)), rel=1e-6, abs=1e-7)


# ---------------------------------------------------------------- batch, files, refusals


def test_a_batch_is_the_loop_over_it():
    gains, stations = np.array([0.0, 0.002, -0.003]), np.array([3.0, 7.0, 12.0])
    batch = stage(gain=gains, station=stations)
    together, response = margins(batch), frequency_response(open_loop(batch), np.geomspace(0.2, 9, 30))
    growth = greatest_growth(open_loop(batch))
    for k in range(3):
        pilot = batch.autopilot.model_copy(update={"accelerometer_gain": float(gains[k])})
        v = batch.vehicle.model_copy(update={"accelerometer_station": float(stations[k])})
        one = batch.model_copy(update={"vehicle": v, "autopilot": pilot})
        np.testing.assert_allclose(
            response.loop[k], frequency_response(open_loop(one), np.geomspace(0.2, 9, 30)).loop, rtol=1e-12
        )
        assert growth[k] == pytest.approx(float(greatest_growth(open_loop(one))), rel=1e-9)
        assert together.nichols_disc_margin[k] == pytest.approx(float(margins(one).nichols_disc_margin), rel=1e-6)
    each = for_each(margins, batch).values("nichols_disc_margin")
    np.testing.assert_allclose(together.nichols_disc_margin, each, rtol=1e-6)


def test_a_file_reads_writes_and_reports_it(tmp_path):
    for k, (case, _) in enumerate(fleet(521, 6, tanks=2, modes=2)):
        pilot = case.autopilot.model_copy(update={"gain": 1.0})
        case = case.model_copy(update={"autopilot": pilot})
        back = read_case(write_case(case, tmp_path / f"{k}.toml"))
        assert back.vehicle == case.vehicle
        assert back.autopilot == case.autopilot
        keys = {row.key for row in input_rows(back)}
        assert {"vehicle.accelerometer_station", "autopilot.accelerometer_gain"} <= keys
        assert "flexible_mode.bending 1.accelerometer.slope" in keys


TEXT = """name = "x"
[vehicle]
mass = "16000 kg"
inertia = "9e5 kg*m^2"
cg = "6 m"
thrust = "900 kN"
accelerometer_station = "7 m"
[[tank]]
name = "LOX"
slosh_mass = "1000 kg"
station = "9 m"
frequency = "2 rad/s"
damping = { law = "constant", ratio = 0.02 }
[[flexible_mode]]
name = "first bending"
frequency = "2.1 Hz"
damping = 0.005
generalized_mass = "9000 kg"
gimbal = { deflection = 1.0, slope = "-0.08 1/m" }
gyro = { slope = "0.05 1/m" }
accelerometer = { deflection = 0.5, slope = "0.05 1/m" }
tank.LOX = { deflection = -0.3, slope = "0.02 1/m" }
[engine]
first_moment = "1500 kg*m"
inertia = "2500 kg*m^2"
[autopilot]
attitude_gain = 0.08
rate_gain = "0.14 s"
accelerometer_gain = "0.2 deg/(m/s^2)"
actuator = { frequency = "6 Hz", damping = 0.7 }
[[autopilot.filter]]
numerator = [1.0]
denominator = [0.02, 1.0]
"""


def test_the_gain_of_a_file_has_units(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(TEXT)
    assert read_case(path).autopilot.accelerometer_gain == pytest.approx(np.radians(0.2))


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "rule"),
    [
        ('accelerometer_station = "7 m"\n', "", 2, "vehicle accelerometer_station", "is missing: the autopilot feeds"),
        ('accelerometer = { deflection = 0.5, slope = "0.05 1/m" }\n', "", 14, 'flexible_mode "first bending" accelerometer', "is missing: the autopilot feeds"),
        ('accelerometer_gain = "0.2 deg/(m/s^2)"\n', "", 7, "vehicle accelerometer_station", "is read by nothing"),
        ('"0.2 deg/(m/s^2)"', "0.003", 29, "autopilot accelerometer_gain", "has no unit"),
        ('"0.2 deg/(m/s^2)"', '"0.003 s^2/m"', 29, "autopilot accelerometer_gain", "does not say of which angle"),
        ('"0.2 deg/(m/s^2)"', '"0.003 deg/m"', 29, "autopilot accelerometer_gain", "is a ratio per length"),
        ("[[autopilot.filter]]\nnumerator = [1.0]\ndenominator = [0.02, 1.0]\n", "", 29, "autopilot accelerometer_gain", "feeds the engine's inertia back at once"),
        ('slope = "0.05 1/m" }\ntank', 'slop = "0.05 1/m" }\ntank', 21, 'flexible_mode "first bending" accelerometer slop', "is an unknown key"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_told_with_its_line(tmp_path, old, new, line, key, rule):
    path = tmp_path / "case.toml"
    assert old in TEXT
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(InputError) as caught:
        read_case(path)
    problem = next(p for p in caught.value.problems if p.key == key)
    assert problem.line == line
    assert rule in problem.rule
    assert problem.cure


def test_a_loop_without_lag_is_refused_and_with_lag_by_either_part_it_is_not():
    with pytest.raises(ValidationError, match="feeds the thrust back at once"):
        stage(actuator=None)
    with pytest.raises(ValidationError, match="feeds the thrust back at once"):
        stage(actuator=Actuator(numerator=(0.5, 10.0), denominator=(1.0, 10.0)), delay=0.05)
    assert stage(actuator=None, filter=(Filter(numerator=(1.0,), denominator=(0.02, 1.0)),)).autopilot.lag_order == 1
    bare = stage().model_copy(update={"autopilot": stage().autopilot.model_copy(update={"actuator": None})})
    with pytest.raises(OutsideValidity, match="feeds the thrust back at once"):
        open_loop(bare)
    nowhere = stage().model_copy(update={"vehicle": stage().vehicle.model_copy(update={"accelerometer_station": None})})
    with pytest.raises(OutsideValidity, match="accelerometer_station is missing"):
        margins(nowhere)
