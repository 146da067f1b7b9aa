"""A flight file with its tables: what is read is what stands there, and every fault is told with its row and cure."""

from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
import scipy.io
from scipy.interpolate import PchipInterpolator

from sloshpy.errors import InputError
from sloshpy.files import read_flight, read_tank
from sloshpy.tank import slosh_masses, tank_damping

CASE = """
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
damping = { law = "power", slope = "0.1 1/m", exponent = 1 }
[autopilot]
attitude_gain = 0.08
rate_gain = "0.14 s"
"""
TABLE = """# made by hand
t [s],m [t],a0,note,F [kN]
0,16,0.08,x,900
10,15.5,0.081,y,910
20,15,0.083,y,930
20,12,0.06,y,600
30,11.6,0.061,y,610
"""
FLIGHT = """
name = "Two burns"
[[table]]
name = "burns"
file = "burns.csv"
interpolation = "linear"
time = "t"
[table.columns]
"vehicle.mass" = "m"
"autopilot.attitude_gain" = "a0"
"vehicle.thrust" = "F"
[[phase]]
name = "first"
case = "stage.toml"
start = "0 s"
end = "20 s"
step = "5 s"
tables = ["burns"]
[[phase]]
name = "second"
case = "stage.toml"
start = "20 s"
end = "30 s"
times = ["24 s"]
tables = ["burns"]
"""
TANK = """
name = "LOX"
fill = "50 %"
acceleration = "9 m/s^2"
bottom_station = "4 m"
damping_floor = "0.2 %"
[liquid]
density = "1141 kg/m^3"
[shape]
kind = "cylinder"
radius = "1.5 m"
height = "6 m"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("stage.toml", CASE), ("burns.csv", TABLE), ("flight.toml", FLIGHT), ("lox.toml", TANK)):
        (tmp_path / name).write_text(text)
    return tmp_path


def spoilt(folder: Path, file: str, *changes: tuple[str, str]):
    """Replace texts in a file and return the problems that reading the flight tells."""
    text = (folder / file).read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / file).write_text(text)
    with pytest.raises(InputError) as caught:
        read_flight(folder / "flight.toml")
    assert all(problem.cure for problem in caught.value.problems)
    return caught.value.problems


def test_a_flight_is_read_at_the_times_asked_for(folder):
    flight = read_flight(folder / "flight.toml")
    first, second = flight.phases
    assert first.time == pytest.approx([0.0, 5.0, 10.0, 15.0, 20.0])
    assert second.time == pytest.approx([20.0, 24.0, 30.0])
    assert first.case.vehicle.mass == pytest.approx([16e3, 15.75e3, 15.5e3, 15.25e3, 15e3])
    assert first.case.autopilot.attitude_gain == pytest.approx([0.08, 0.0805, 0.081, 0.082, 0.083])
    assert first.case.vehicle.vectored_thrust == pytest.approx(first.case.vehicle.thrust)  # all of it is gimballed


def test_no_number_is_interpolated_across_an_event(folder):
    first, second = read_flight(folder / "flight.toml").phases
    assert first.case.vehicle.mass[-1] == pytest.approx(15e3)  # before
    assert second.case.vehicle.mass[0] == pytest.approx(12e3)  # after, at the same time
    assert second.case.vehicle.mass[1] == pytest.approx(12e3 - 0.4 * 400.0)


def test_an_event_is_found_in_milliseconds_too(folder):
    text = FLIGHT.replace('"0 s"', '"0.07 s"').replace('"20 s"', '"20.07 s"')
    (folder / "flight.toml").write_text(text)
    rows = [line.split(",", 1) for line in TABLE.splitlines()[2:]]
    moved = [f"{1000 * float(time) + 70 * (time != '30'):g},{rest}" for time, rest in rows]
    (folder / "burns.csv").write_text("\n".join(["t [ms],m [t],a0,note,F [kN]", *moved]))
    first, second = read_flight(folder / "flight.toml").phases
    assert first.case.vehicle.mass[-1] == pytest.approx(15e3)
    assert second.case.vehicle.mass[0] == pytest.approx(12e3)


def test_a_monotone_cubic_stays_within_its_neighbours_and_sees_its_own_phase_only(folder):
    (folder / "flight.toml").write_text(FLIGHT.replace('"linear"', '"pchip"'))
    mass = read_flight(folder / "flight.toml").phases[0].case.vehicle.mass
    assert mass == pytest.approx(PchipInterpolator([0, 10, 20], [16e3, 15.5e3, 15e3])([0, 5, 10, 15, 20]))
    assert np.all(np.diff(mass) < 0.0)


def test_a_frequency_without_a_schedule_follows_the_acceleration_and_a_note_says_so(folder):
    phase = read_flight(folder / "flight.toml").phases[0]
    tank, a = phase.case.vehicle.tanks[0], np.asarray(phase.case.vehicle.acceleration)
    assert tank.frequency == pytest.approx(2.0 * np.sqrt(a / (900e3 / 16e3)))
    assert "square root of the acceleration" in phase.notes[0]


def test_a_pendulum_follows_the_acceleration_by_itself(folder):
    pendulum = CASE.replace('station = "9 m"\nfrequency = "2 rad/s"', 'hinge_station = "12 m"\npendulum_length = "3 m"')
    (folder / "stage.toml").write_text(pendulum)
    phase = read_flight(folder / "flight.toml").phases[0]
    assert np.array([c.vehicle.tanks[0].frequency for c in phase.cases]) == pytest.approx(
        np.sqrt(np.asarray(phase.case.vehicle.acceleration) / 3.0)
    )
    assert phase.at(2.5).vehicle.tanks[0].station == pytest.approx(9.0)


@pytest.mark.parametrize(
    ("field", "header", "pendulum"),
    [
        ("station", "x [m]", True),
        ("frequency", "x [rad/s]", True),
        ("hinge_station", "x [m]", False),
        ("pendulum_length", "x [m]", False),
    ],
)
def test_a_schedule_of_the_form_that_the_case_does_not_have_is_refused(folder, field, header, pendulum):
    if pendulum:
        other = 'hinge_station = "12 m"\npendulum_length = "3 m"'
        (folder / "stage.toml").write_text(CASE.replace('station = "9 m"\nfrequency = "2 rad/s"', other))
    (folder / "burns.csv").write_text(TABLE.replace("note", header).replace(",x,", ",8,").replace(",y,", ",7,"))
    text = FLIGHT.replace('"vehicle.thrust" = "F"', f'"tank.LOX.{field}" = "x"')
    (folder / "flight.toml").write_text(text)
    with pytest.raises(InputError, match="is not how the case gives this tank, which is a") as caught:
        read_flight(folder / "flight.toml")
    assert len(caught.value.problems) == 1
    assert ("hinge_station and pendulum_length" if pendulum else "station and frequency") in str(caught.value)


def test_a_fill_of_a_pendulum_is_refused(folder):
    other = 'hinge_station = "12 m"\npendulum_length = "3 m"'
    (folder / "stage.toml").write_text(CASE.replace('station = "9 m"\nfrequency = "2 rad/s"', other))
    text = FLIGHT.replace('"vehicle.thrust" = "F"', '"tank.LOX.fill" = { column = "F", tank_file = "lox.toml" }')
    (folder / "flight.toml").write_text(text)
    with pytest.raises(InputError, match="fills a tank that the case gives as a pendulum"):
        read_flight(folder / "flight.toml")


def test_two_schedules_of_one_slope_are_refused(folder):
    air = '[aerodynamics]\nnormal_force_slope = "2e5 N"\ncenter_of_pressure = "9 m"\nspeed = "400 m/s"\n'
    (folder / "stage.toml").write_text(CASE + air)
    (folder / "burns.csv").write_text("t [s],q [kPa],k [N]\n0,10,1e5\n20,40,2e5\n20,40,2e5\n30,20,1e5\n")
    columns = FLIGHT[FLIGHT.index('"vehicle.mass"') : FLIGHT.index("[[phase]]")]
    mapped = '"aerodynamics.dynamic_pressure" = "q"\n', '"aerodynamics.normal_force_slope" = "k"\n'
    for both in (mapped, mapped[::-1]):
        text = FLIGHT.replace(columns, "".join(both))
        text = text.replace("tables =", 'reference_dynamic_pressure = "20 kPa"\ntables =')
        (folder / "flight.toml").write_text(text)
        with pytest.raises(InputError, match="stands beside"):
            read_flight(folder / "flight.toml")


def test_fills_become_slosh_masses_at_each_acceleration_with_the_tanks_own_damping(folder):
    (folder / "stage.toml").write_text(
        CASE[: CASE.index("slosh_mass")] + 'tank_file = "lox.toml"\n' + CASE[CASE.index("[autopilot]") :]
    )
    (folder / "fills.csv").write_text("t [s],LOX\n0,60\n20,40\n")
    more = """[[table]]
name = "fills"
file = "fills.csv"
interpolation = "linear"
time = "t"
[table.columns]
"tank.LOX.fill" = { column = "LOX", unit = "%", tank_file = "lox.toml" }
"""
    text = FLIGHT.replace("[[phase]]", more + "[[phase]]", 1).replace(
        'tables = ["burns"]', 'tables = ["burns", "fills"]', 1
    )
    (folder / "flight.toml").write_text(text)
    phase = read_flight(folder / "flight.toml").phases[0]
    assert phase.fill[:, 0] == pytest.approx([0.6, 0.55, 0.5, 0.45, 0.4])
    assert not any("density" in note for note in phase.notes)
    (folder / "lox.toml").write_text((folder / "lox.toml").read_text().replace("1141 kg/m^3", "50 kg/m^3"))
    doubted = read_flight(folder / "flight.toml").phases[0].notes
    assert [note[:59] for note in doubted if "density" in note] == [
        "LOX, at 0 s and at 4 more times: caution: a density of 50 k"
    ]
    (folder / "lox.toml").write_text(TANK)
    tank = read_tank(folder / "lox.toml")
    for k in (0, 3):
        fields = {name: getattr(tank, name) for name in type(tank).model_fields}
        a = float(phase.cases[k].vehicle.acceleration)
        alone = slosh_masses(type(tank)(**fields | {"fill": f"{100 * phase.fill[k, 0]} %", "acceleration": a}))
        mass = phase.cases[k].vehicle.tanks[0]
        assert mass.slosh_mass == pytest.approx(float(alone.slosh_mass[0]))
        assert mass.frequency == pytest.approx(float(alone.frequency[0]))
        assert mass.station == pytest.approx(4.0 + float(alone.spring_height[0]))
        assert float(mass.damping.ratio(0.1)) == pytest.approx(float(tank_damping(alone).law.ratio(0.1)))


def test_dynamic_pressure_scales_the_normal_force(folder):
    air = '[aerodynamics]\nnormal_force_slope = "2e5 N"\ncenter_of_pressure = "9 m"\nspeed = "400 m/s"\n'
    (folder / "stage.toml").write_text(CASE + air)
    (folder / "burns.csv").write_text("t [s],q [kPa]\n0,10\n20,40\n20,40\n30,20\n")
    columns = FLIGHT[FLIGHT.index('"vehicle.mass"') : FLIGHT.index("[[phase]]")]
    text = FLIGHT.replace(columns, '"aerodynamics.dynamic_pressure" = "q"\n')
    text = text.replace("tables =", 'reference_dynamic_pressure = "20 kPa"\ntables =')
    (folder / "flight.toml").write_text(text)
    slope = read_flight(folder / "flight.toml").phases[0].case.vehicle.aerodynamics.normal_force_slope
    assert slope == pytest.approx([1e5, 1.75e5, 2.5e5, 3.25e5, 4e5])
    problems = spoilt(folder, "burns.csv", ("0,10\n", "0,0\n"))
    assert problems[0].line == 2
    assert "> 0" in problems[0].rule


@pytest.mark.parametrize("suffix", ["xlsx", "mat", "nc", "h5", "v7.3"])
def test_every_format_gives_the_numbers_of_the_csv(folder, suffix):
    expected = read_flight(folder / "flight.toml").phases
    rows = [line.split(",") for line in TABLE.splitlines()[2:]]
    names = {"t": "s", "m": "t", "a0": "", "F": "kN"}
    columns = {name: np.array([float(row[k]) for row in rows]) for name, k in zip(names, (0, 1, 2, 4), strict=True)}
    file = folder / ("burns.mat" if suffix == "v7.3" else f"burns.{suffix}")
    if suffix == "xlsx":
        book = openpyxl.Workbook()
        book.active.append([f"{name} [{unit}]" if unit else name for name, unit in names.items()])
        for row in zip(*columns.values(), strict=True):
            book.active.append([float(x) for x in row])
        book.save(file)
    elif suffix == "mat":
        scipy.io.savemat(file, columns | {f"{name}_unit": unit for name, unit in names.items() if unit})
    else:
        with h5py.File(file, "w", userblock_size=512 if suffix == "v7.3" else 0) as store:
            for name, values in columns.items():
                scale = 0.5 if suffix == "nc" and name == "F" else 1.0  # packed numbers are unpacked
                store[name] = values / scale
                store[name].attrs["units"] = names[name]
                if scale != 1.0:
                    store[name].attrs["scale_factor"] = scale
        if suffix == "v7.3":
            with open(file, "r+b") as stream:
                stream.write(b"MATLAB 7.3 MAT-file".ljust(128))
    (folder / "flight.toml").write_text(FLIGHT.replace("burns.csv", file.name))
    found = read_flight(folder / "flight.toml").phases
    for one, other in zip(found, expected, strict=True):
        assert one.case.vehicle.mass == pytest.approx(other.case.vehicle.mass)
        assert one.case.vehicle.thrust == pytest.approx(other.case.vehicle.thrust)


def test_a_missing_value_and_a_link_to_another_file_are_refused(folder):
    def stored(**more):
        with h5py.File(folder / "burns.nc", "w") as store:
            for name, unit, values in (("t", "s", [0.0, 20.0, 30.0]), ("m", "t", [16.0, -999.0, 15.0])):
                store[name] = np.array(values)
                store[name].attrs["units"] = unit
            for name in ("a0", "F"):
                store[name] = more.get(name, np.array([1.0, 1.0, 1.0]))
            store["F"].attrs["units"] = "kN"
            store["m"].attrs["_FillValue"] = -999.0

    stored()
    problems = spoilt(folder, "flight.toml", ("burns.csv", "burns.nc"))
    assert any("are missing" in problem.rule for problem in problems)
    with h5py.File(folder / "other.h5", "w") as store:
        store["x"] = np.ones(3)
    stored()
    with h5py.File(folder / "burns.nc", "a") as store:
        del store["a0"]
        store["a0"] = h5py.ExternalLink("other.h5", "x")
    assert any("link" in problem.rule for problem in spoilt(folder, "flight.toml"))


@pytest.mark.parametrize(
    ("file", "old", "new", "line", "rule"),
    [
        ("burns.csv", "10,15.5", "10,16.5", 4, "rises from 16000 kg in line 3"),
        ("burns.csv", "10,15.5", "10,15.1", 4, "falls by 5.63 % from line 3"),
        ("burns.csv", "10,15.5", "10,-15.5", 4, "must be > 0 kg"),
        ("burns.csv", "10,15.5", "10,abc", 4, "must start with a number"),
        ("burns.csv", "10,15.5", "10,", 4, "is blank"),
        ("burns.csv", "0,16,", "10,16,", 4, "stands twice, first in line 3"),
        ("burns.csv", "10,15.5", "21,15.5", 5, "must increase, but follows 21 s in line 4"),
        ("burns.csv", "20,15,0.083,y,930\n20,", "20,", 5, "stands once, for the end of phase"),
        ("burns.csv", "20,15,0.083,y,930\n20,", "19,15,0.083,y,930\n21,", 5, "has no row at 20 s, the end"),
        ("burns.csv", "m [t]", "m", 2, "has no unit"),
        ("burns.csv", "m [t]", "m [m]", 2, "is a length, must be a mass"),
        ("flight.toml", '= "m"', '= { column = "m", unit = "t" }', 2, "has a unit here and in the flight file"),
        ("flight.toml", '= "m"', '= "mass"', 2, "is not in the file"),
        ("flight.toml", '"vehicle.mass"', '"vehicle.mas"', 9, 'has no quantity "mas"'),
        ("flight.toml", '"vehicle.mass"', '"tank.LH2.slosh_mass"', 9, "names no tank of the case"),
        ("flight.toml", '"vehicle.mass"', '"autopilot.filter"', 9, "names a filter, and the case has none"),
        ("flight.toml", '"linear"', '"cubic"', 6, "must be linear or pchip"),
        ("flight.toml", 'interpolation = "linear"\n', "", 3, "is missing"),
        ("flight.toml", 'end = "20 s"', 'end = "25 s"', 22, "lies before the end of the phase before, 25 s"),
        ("flight.toml", 'end = "20 s"', "end = 20", 16, "has no unit"),
        ("flight.toml", 'step = "5 s"', 'step = "0 s"', 17, "must be > 0 s"),
        ("flight.toml", '["24 s"]', '["34 s"]', 24, "reach beyond the phase"),
        ("flight.toml", "burns.csv", "../burns.csv", 5, "leads out of the flight file's folder"),
        ("flight.toml", "burns.csv", "burns.pkl", 5, "must end in .csv"),
        ("flight.toml", "burns.csv", "gone.csv", 5, "does not exist"),
        ("flight.toml", 'tables = ["burns"]', 'tables = ["burn"]', 18, 'names no table "burn"'),
        ("flight.toml", 'tables = ["burns"]\n', "", 12, "is missing"),
        ("flight.toml", "interpolation", "interpolate", 6, "is an unknown key"),
        ("stage.toml", 'mass = "16 t"', 'mass = "-16 t"', 4, "must be > 0 kg"),
        ("stage.toml", 'thrust = "900 kN"', 'thrust = "900 kN"\ndrag = "700 kN"', 19, "drag is at least the thrust"),
        ("stage.toml", 'slosh_mass = "1000 kg"', 'slosh_mass = "11 t"', 19, "makes the mass matrix indefinite"),
    ],
)  # fmt: skip
def test_a_fault_is_told_with_its_row(folder, file, old, new, line, rule):
    problems = spoilt(folder, file, (old, new))
    told = [problem for problem in problems if rule in problem.rule]
    assert told, [str(problem) for problem in problems]
    assert told[0].line == line, str(told[0])


@pytest.mark.parametrize("step", ['step = "0 s"', "step = 5", ""])
def test_a_phase_whose_times_are_wrong_still_uses_its_table(folder, step):
    text = FLIGHT.replace('step = "5 s"', step)
    (folder / "flight.toml").write_text(text[: text.index('[[phase]]\nname = "second"')])
    with pytest.raises(InputError) as caught:
        read_flight(folder / "flight.toml")
    (problem,) = caught.value.problems
    assert problem.key.endswith("step")


def test_every_fault_is_told_at_once_and_nothing_is_guessed(folder):
    (folder / "burns.csv").write_text(TABLE.replace("10,15.5", "10,16.5").replace("30,11.6", "30,12.6"))
    problems = spoilt(folder, "flight.toml", ("start", "stat"))
    assert any("unknown key" in problem.rule for problem in problems)
    (folder / "flight.toml").write_text(FLIGHT)
    rows = [problem.line for problem in spoilt(folder, "flight.toml") if "rises" in problem.rule]
    assert rows == [4, 7]
