"""Vehicles that bend, swing heavy engines and fly through air, against the second implementation in oracle_flexible."""

import json

import numpy as np
import pytest
from pydantic import ValidationError

import oracle
import oracle_flexible as second
from cases import real_case, xi
from held import hold_history, hold_zeros
from sloshpy.autopilot import Filter
from sloshpy.cli import main
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.dynamics import frequency_response, open_loop, plant, without_drift
from sloshpy.dynamics.growth import greatest_growth, is_stable
from sloshpy.dynamics.poles import closed_loop_eigenvalues, unstable_count
from sloshpy.files import read_case, write_case
from sloshpy.stability import margins
from sloshpy.vehicle import Aerodynamics, Engine, FlexibleMode, ModeShape, ModeSlope, SloshMass, Vehicle

# The case file that the format's description prints
PRINTED = """
name = "Hypothetical large upper stage"

[vehicle]
mass = "16000 kg"
inertia = "9e5 kg*m^2"
cg = "6 m"
thrust = "900 kN"
vectored_thrust = "900 kN"
drag = "0 N"

[[tank]]
name = "LOX"
slosh_mass = "1000 kg"
station = "9 m"
frequency = "2 rad/s"
radius = "2.5 m"
damping = { law = "power", slope = "0.1 1/m", exponent = 1 }

[[flexible_mode]]
name = "first bending"
frequency = "2.1 Hz"
damping = 0.005
generalized_mass = "9000 kg"
gimbal = { deflection = 1.0, slope = "-0.08 1/m" }
gyro = { slope = "0.05 1/m" }
tank.LOX = { deflection = -0.3, slope = "0.02 1/m" }

[engine]
first_moment = "1500 kg*m"
inertia = "2500 kg*m^2"

[aerodynamics]
normal_force_slope = "2e5 N"
center_of_pressure = "12 m"
speed = "400 m/s"

[autopilot]
attitude_gain = 0.08
rate_gain = "0.14 s"
gain = "0 dB"
delay = "0 s"
actuator = { frequency = "6 Hz", damping = 0.7, deflection_limit = "6 deg", rate_limit = "15 deg/s" }
[[autopilot.filter]]
numerator = [1.0]
denominator = [0.02, 1.0]

[criteria]
gain_margin = "6 dB"
phase_margin = "30 deg"
disc_margin = 1.0
limit_cycle_disc_margin = 1.1
tvc_amplitude = "0.5 deg"
"""


def fleet(seed, count, **parts):
    rng = np.random.default_rng(seed)
    return [real_case(rng, **parts) for _ in range(count)]


@pytest.fixture(scope="module")
def many():
    """2000 vehicles of 1 to 4 tanks and 0 to 3 bending modes, each other part in about half of them."""
    cases = fleet(81, 2000)
    vehicles = [case.vehicle for case, _ in cases]
    assert {len(v.tanks) for v in vehicles} == {1, 2, 3, 4}
    assert {len(v.flexible_modes) for v in vehicles} == {0, 1, 2, 3}
    aloft = [v for v in vehicles if v.aerodynamics]
    ahead = [v for v in aloft if v.aerodynamics.center_of_pressure > v.cg]
    assert 800 < len(aloft) < 1200
    assert 400 < len(ahead) < len(aloft) - 200
    assert 800 < sum(v.engine is not None for v in vehicles) < 1200
    assert 800 < sum(case.autopilot.delay > 0 for case, _ in cases) < 1200
    return [(case, xi, second.second_order(case.vehicle, xi), open_loop(case, damping=xi)) for case, xi in cases]


def test_loop_and_slosh_response_agree_on_2000_vehicles(many):
    for case, _, p, loop in many:
        v = case.vehicle
        own = np.array([t.frequency for t in v.tanks] + [f.frequency for f in v.flexible_modes])
        w = np.concatenate([np.geomspace(0.05, 10, 12) * own[0], own])
        L, z, cancelled = second.solved(p, case.autopilot, 1j * w)
        r = frequency_response(loop, w)
        # each route cancels what `cancelled` says at a zero of L; it is below 1e3 on all of these
        assert np.all(np.abs(r.loop - L) < 1e-10 * np.abs(L)), (np.abs(r.loop / L - 1).max(), cancelled.max())
        # near a zero of z/beta the solve has cancelled digits of the response elsewhere
        assert np.all(np.abs(r.slosh - z) < 1e-10 * np.abs(z) + 1e-14 * np.abs(z).max(axis=0))


def test_the_stability_verdict_and_the_count_of_unstable_poles_agree_on_2000_vehicles(many):
    """Poles, encirclement count and the oracle's own: a generalised eigenvalue or an argument principle of its own."""
    unstable = 0
    for k, (case, _, p, loop) in enumerate(many):
        values = closed_loop_eigenvalues(loop)
        growth = np.nanmax(values.real)
        # within this of the axis the rounding of an eigenvalue decides; with this seed none is
        assert abs(growth) > 1e-9
        # 1e-9: both stop within 1e-12 of the root, after different numbers of Newton steps
        assert growth == pytest.approx(float(greatest_growth(loop)), rel=1e-9, abs=1e-11)
        assert (growth < 0) == second.stable(p, case.autopilot) == bool(is_stable(loop)), k
        assert np.sum(values[np.isfinite(values)].real > 0) == unstable_count(loop), k
        unstable += growth > 0
    assert 500 < unstable < 1500  # both verdicts are well represented


def test_every_closed_loop_pole_makes_the_oracles_equations_singular(many):
    for case, _, p, loop in many:
        values = closed_loop_eigenvalues(loop)
        # 1e-9 of the scaled entries: a pole nearer the origin than 1e-3 rad/s is polished absolutely, not relatively
        assert second.backward_error(p, case.autopilot, values[np.isfinite(values)]).max() < 1e-9


def test_without_a_delay_the_poles_are_the_oracles_one_by_one(many):
    for case, _, p, loop in many:
        if case.autopilot.delay:
            continue
        ours, theirs = closed_loop_eigenvalues(loop), second.poles(p, case.autopilot)
        assert len(ours) == len(theirs)
        for s in theirs:
            # 1e-6: nearly double filter and actuator poles lose half the digits of a double
            assert np.abs(ours - s).min() < 1e-6 * max(abs(s), 1e-2)


def test_a_long_delay_hides_no_unstable_bending_mode():
    """Bending at 19 rad of delay: one Pade approximation misplaces its pole, and polishing then finds another root."""
    case, damping = fleet(82, 624)[623]
    p, loop = second.second_order(case.vehicle, damping), open_loop(case, damping=damping)
    assert max(f.frequency for f in case.vehicle.flexible_modes) * case.autopilot.delay > 19
    assert second.unstable_poles(p, case.autopilot) == unstable_count(loop) == 2
    assert greatest_growth(loop) > 0
    assert not margins(case, damping=damping).stable


def test_the_encirclement_count_loses_no_turn_of_a_long_delay():
    """Heavy engines keep the gain up where the delay turns the loop many times; the reach of the path is no matter."""
    for seed, k in ((82, 118), (81, 401)):
        case, damping = fleet(seed, k + 1)[k]
        p, loop = second.second_order(case.vehicle, damping), open_loop(case, damping=damping)
        counts = {unstable_count(loop, decades) for decades in (2.0, 3.0, 4.0, 5.0, 6.0)}
        assert counts == {second.unstable_poles(p, case.autopilot)}
        values = closed_loop_eigenvalues(loop)
        assert counts == {int(np.sum(values[np.isfinite(values)].real > 0))}


def test_drift_takes_two_neutral_poles_along_and_one_where_the_air_holds_the_lateral_speed(many):
    for case, damping, p, loop in many[:200]:
        air = case.vehicle.aerodynamics is not None
        assert loop.plant.drift_poles == p.drift == (1 if air else 2)
        _, A, _ = second.descriptor(p, case.autopilot.model_copy(update={"delay": 0.0}))
        prompt = case.model_copy(update={"autopilot": case.autopilot.model_copy(update={"delay": 0.0})})
        assert len(closed_loop_eigenvalues(open_loop(prompt, damping=damping))) == len(A) - p.drift
        assert without_drift(plant(case.vehicle)).velocity_only == air


# ---------------------------------------------------------------- a batch


def stacked(nouns):
    """One value of the kind of the given ones, each number an array along a new leading axis."""
    first = nouns[0]
    if isinstance(first, bool | str) or first is None:
        return first
    if isinstance(first, int | float):
        return np.array(nouns, dtype=float)
    if isinstance(first, tuple):
        return tuple(stacked(parts) for parts in zip(*nouns, strict=True))
    if isinstance(first, dict):
        return {key: stacked([noun[key] for noun in nouns]) for key in first}
    if isinstance(first, ConstantDamping):
        return first
    return type(first)(**{key: stacked([getattr(noun, key) for noun in nouns]) for key in type(first).model_fields})


def test_a_batch_of_flexible_vehicles_is_the_loop_over_them():
    rng = np.random.default_rng(83)
    for air in (False, True):
        cases = [real_case(rng, tanks=2, modes=2, engine=True, air=air) for _ in range(6)]
        shared, pilot = cases[0][0], cases[0][0].autopilot
        vehicles = []
        for case, _ in cases:
            modes = tuple(
                f.model_copy(update={"rate_gyro": f.rate_gyro or ModeSlope(slope=0.01)})
                for f in case.vehicle.flexible_modes
            )
            vehicles.append(case.vehicle.model_copy(update={"flexible_modes": modes}))
        damping = np.array([d for _, d in cases])
        batch = shared.model_copy(update={"vehicle": stacked(vehicles), "autopilot": pilot})
        w = np.geomspace(0.1, 50, 40)
        together = open_loop(batch, damping=damping)
        response, growth, found = frequency_response(together, w), greatest_growth(together), margins(batch, damping)
        assert response.loop.shape == (6, 40)
        for k, v in enumerate(vehicles):
            single = shared.model_copy(update={"vehicle": v})
            alone = open_loop(single, damping=damping[k])
            one = frequency_response(alone, w)
            # the same operations in another order of memory: a few roundings, times the condition of the solve
            np.testing.assert_allclose(response.loop[k], one.loop, rtol=1e-11)
            np.testing.assert_allclose(response.slosh[k], one.slosh, rtol=1e-10)
            assert growth[k] == pytest.approx(float(greatest_growth(alone)), rel=1e-7, abs=1e-10)
            least = margins(single, damping[k])
            assert found.stable[k] == least.stable
            # 1e-6: the valley of eq 24 is found to its own rounding; the frequencies tried differ with the batch
            assert found.nichols_disc_margin[k] == pytest.approx(float(least.nichols_disc_margin), rel=1e-6)


@pytest.mark.parametrize("field", ["normal_force_slope", "center_of_pressure", "speed", "first_moment", "inertia"])
def test_one_field_of_air_or_engine_alone_may_be_the_batch(field):
    case, damping = fleet(84, 1, tanks=2, modes=1, engine=True, air=True)[0]
    v = case.vehicle
    name = "aerodynamics" if hasattr(v.aerodynamics, field) else "engine"
    values = getattr(getattr(v, name), field) * np.array([0.8, 1.0, 1.2])
    w = np.geomspace(0.1, 50, 30)

    def at(value):
        part = getattr(v, name).model_copy(update={field: value})
        there = case.model_copy(update={"vehicle": v.model_copy(update={name: part})})
        return frequency_response(open_loop(there, damping=damping), w).loop

    together = at(values)
    np.testing.assert_allclose(together, [at(x) for x in values], rtol=1e-11)
    assert np.abs(together[0] / together[2] - 1).max() > 1e-6  # the field counts


def test_a_batch_in_which_only_some_vehicles_feel_the_air_is_refused():
    """Those that do not have another neutral pole, which would pass for an instability."""
    case, _ = fleet(85, 1, tanks=1, modes=0, engine=False, air=True)[0]
    air = case.vehicle.aerodynamics
    given = {k: getattr(case.vehicle, k) for k in type(case.vehicle).model_fields}

    def felt(slope):
        return Vehicle(**given | {"aerodynamics": air.model_copy(update={"normal_force_slope": slope})})

    assert without_drift(plant(felt(0.0))).drift_poles == 2
    assert without_drift(plant(felt(np.array([0.0, 0.0])))).drift_poles == 2
    assert without_drift(plant(felt(np.array([1e5, 2e5])))).drift_poles == 1
    with pytest.raises(ValidationError, match="0 for some vehicles of the batch"):
        felt(np.array([0.0, 1e5]))


# ---------------------------------------------------------------- margins


def test_every_minimum_of_the_disc_margin_on_a_dense_grid_is_listed():
    for case, damping in fleet(86, 60):
        p = second.second_order(case.vehicle, damping)
        found = margins(case, damping=damping)
        size = np.abs(second.poles(p, case.autopilot.model_copy(update={"delay": 0.0})))
        w = np.geomspace(0.1 * min(t.frequency for t in case.vehicle.tanks), 3 * size.max(), 20001)
        L = np.concatenate([second.solved(p, case.autopilot, 1j * part)[0] for part in np.array_split(w, 20)])
        dm = oracle.disc_margin(L)
        ours, value = found.minima.omega, found.minima.value
        ours, value = ours[np.isfinite(ours)], value[np.isfinite(ours)]
        near = value < 4
        there = oracle.disc_margin(second.solved(p, case.autopilot, 1j * ours[near])[0])
        np.testing.assert_allclose(value[near], there, rtol=1e-7, atol=1e-9)
        assert value.min(initial=4.0) <= dm.min() * (1 + 1e-6)  # the static end: one sample for all lower ones
        valley = np.flatnonzero((dm[1:-1] < dm[:-2]) & (dm[1:-1] < dm[2:]) & (dm[1:-1] < 4)) + 1
        for k in valley:
            close = (ours > w[k - 1] * (1 - 1e-9)) & (ours < w[k + 1] * (1 + 1e-9))
            assert np.any(close & (value <= dm[k] * (1 + 1e-9))), (w[k], dm[k])


def test_the_static_gain_margin_of_an_unstable_airframe_counts():
    """L(0) is finite with air: -20 log10 |L(0)| is how far the gain may fall before the vehicle diverges slowly."""
    seen = 0
    for case, damping in fleet(90, 60, engine=False, air=True, delay=False):
        p = second.second_order(case.vehicle, damping)
        still = 1e-6 * np.abs(second.poles(p, case.autopilot)).min()
        L = second.solved(p, case.autopilot, 1j * np.array([still, 10 * still]))[0]
        static = oracle.disc_margin(L)[0]
        found = margins(case, damping=damping)
        # 1e-3: the sample that stands for it lies a hundred times below the slowest pole or zero
        assert abs(found.nichols_disc_margin) <= static * (1 + 1e-3)
        seen += static < 3 and L[0].real < 0
    assert seen > 5


def test_the_zeros_of_the_loop_are_the_oracles_with_heavy_engines_too():
    for engine in (False, True):
        hold_zeros(fleet(91, 20, engine=engine, delay=False))


# ---------------------------------------------------------------- time domain


def test_time_histories_of_three_flexible_vehicles_agree_with_dop853():
    rng, done = np.random.default_rng(87), 0
    while done < 3:
        case, damping = real_case(rng, tanks=1 + done, modes=1 + done % 2, engine=True, air=True, delay=False)
        p = second.second_order(case.vehicle, damping)
        # an unstable loop makes both routes grow their errors with the motion
        if second.poles(p, case.autopilot).real.max() > 0.1:
            continue
        hold_history(rng, case, damping, duration=15)
        done += 1


# ---------------------------------------------------------------- files


def test_a_case_with_every_part_reads_back_equal(tmp_path):
    for k, (case, _) in enumerate(fleet(88, 20, tanks=3, modes=3, engine=True, air=True)):
        v = case.vehicle
        laws = (
            PowerDamping(slope=0.1, exponent=0.5),
            TableDamping(amplitude=(0.0, 0.1, 0.2), ratio=(0.002, 0.01, 0.03)),
            SumDamping(of=(xi(0.001), PowerDamping(slope=0.2, exponent=1.0))),
        )
        tanks = tuple(
            SloshMass(**{**{f: getattr(t, f) for f in SloshMass.model_fields}, "damping": law, "radius": 1.5})
            for t, law in zip(v.tanks, laws, strict=True)
        )
        pilot = case.autopilot
        pilot = pilot.model_copy(
            update={
                "gain": 1.0,  # dB: other gains come back to the nearest double or its neighbour
                "actuator": pilot.actuator.model_copy(update={"deflection_limit": 0.1, "rate_limit": 0.3}),
                "filter": (*pilot.filter, Filter(numerator=(1.0,), denominator=(0.02, 1.0))),
            }
        )
        whole = case.model_copy(update={"vehicle": v.model_copy(update={"tanks": tanks}), "autopilot": pilot})
        back = read_case(write_case(whole, tmp_path / f"{k}.toml"))
        assert back.autopilot == whole.autopilot
        assert back.criteria == whole.criteria
        assert [repr(t) for t in back.vehicle.tanks] == [repr(t) for t in tanks]  # repr: a table holds arrays
        assert back.vehicle.model_copy(update={"tanks": ()}) == v.model_copy(update={"tanks": ()})


def test_the_case_file_of_the_formats_description_reads_as_it_says(tmp_path):
    path = tmp_path / "printed.toml"
    path.write_text(PRINTED, encoding="utf-8")
    v = read_case(path).vehicle
    assert v.flexible_modes == (
        FlexibleMode(
            name="first bending",
            frequency=2 * np.pi * 2.1,
            damping=0.005,
            generalized_mass=9000.0,
            gimbal=ModeShape(deflection=1.0, slope=-0.08),
            gyro=ModeSlope(slope=0.05),
            tank={"LOX": ModeShape(deflection=-0.3, slope=0.02)},
        ),
    )
    assert v.engine == Engine(first_moment=1500.0, inertia=2500.0)
    assert v.aerodynamics == Aerodynamics(normal_force_slope=2e5, center_of_pressure=12.0, speed=400.0)


def strict(text):
    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refuse)


def assessed(path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["assess", str(path), "--json"])
    printed = capsys.readouterr()
    assert stopped.value.code in (0, 1), printed.err
    assert printed.err == ""
    return strict(printed.out)


def test_the_case_file_of_the_formats_description_is_assessed_as_the_oracle_does(tmp_path, capsys):
    path = tmp_path / "printed.toml"
    path.write_text(PRINTED, encoding="utf-8")
    case = read_case(path)
    review = assessed(path, capsys)
    p = second.second_order(case.vehicle, [0.0])  # small amplitude: the power law damps nothing
    assert review["stable"] == second.stable(p, case.autopilot)
    assert {m["kind"] for m in review["modes"]} == {"slosh", "rigid", "flexible", "actuator", "filter"}


def test_the_assessment_of_30_vehicles_is_strict_json_with_the_oracles_verdict(tmp_path, capsys):
    for k, (case, damping) in enumerate(
        fleet(89, 30, tanks=1)
    ):  # one tank each: a review asks thousands of loops of every tank
        path = write_case(case, tmp_path / f"{k}.toml")
        review = assessed(path, capsys)
        again = read_case(path)
        p = second.second_order(again.vehicle, damping)
        assert review["stable"] == second.stable(p, again.autopilot), k
        assert review["disc_margin"]["value"] is None or (review["disc_margin"]["value"] > 0) == review["stable"]
        assert [t["name"] for t in review["tanks"]] == [t.name for t in case.vehicle.tanks]
        names = {m["name"] for m in review["modes"]}
        assert names >= {f.name for f in case.vehicle.flexible_modes} or case.autopilot.delay
