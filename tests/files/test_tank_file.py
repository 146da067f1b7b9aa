"""A tank file becomes the tank it describes, alone or in a case, or is refused with line, key, rule and cure."""

from pathlib import Path

import numpy as np
import pytest
from good_case import GOOD, POWER

from sloshpy.assess import assess
from sloshpy.damping import ConstantDamping, PowerDamping
from sloshpy.errors import InputError
from sloshpy.files import read_case, read_fill_table, read_tank, write_case, write_example, write_fill_history
from sloshpy.tank import slosh_masses, slosh_masses_history, tank_damping
from sloshpy.tank.tank import NAME
from sloshpy.tank.wall_damping import mikishev_cylinder, stephens_cylinder
from sloshpy.vehicle import slosh_mass

TANK = """\
name = "LOX"
fill = "6.2 m"
acceleration = "12.1 m/s^2"
bottom_station = "4 m"
[liquid]
density = "1141 kg/m^3"
[shape]
kind = "cylinder"
radius = "2.5 m"
height = "10 m"
[[baffle]]
kind = "ring"
height = "5.9 m"
width = "0.2 m"
"""
OWN = 'slosh_mass = "1000 kg"\nstation = "9 m"\nfrequency = "2 rad/s"\n'
SHAPE = 'kind = "cylinder"\nradius = "2.5 m"\nheight = "10 m"\n'


def _read(folder: Path, *changes: tuple[str, str], contour: str = ""):
    text = TANK
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "lox.toml").write_text(text, encoding="utf-8")
    if contour:
        (folder / "c.csv").write_text(contour, encoding="utf-8")
    return read_tank(folder / "lox.toml")


def test_a_tank_file_is_read_in_any_units(tmp_path):
    tank = _read(tmp_path, ('"6.2 m"', '"244.09448818897638 in"'), ('"1141 kg/m^3"', '"71.23 lbm/ft^3"'))
    assert tank.depth == pytest.approx(6.2)
    assert tank.liquid.density == pytest.approx(1141.0, rel=1e-4)
    assert tank.baffle[0].width == 0.2
    assert _read(tmp_path, ('"6.2 m"', '"62 %"')).depth == pytest.approx(6.2)


def test_a_contour_file_gives_the_cylinders_values(tmp_path):
    contour = "z [ft], r [m]  # floor, wall\n0, 0\n0, 2.5\n32.808398950131235, 2.5\n"
    by_points = _read(tmp_path, (SHAPE, 'kind = "contour"\nfile = "c.csv"\n'), contour=contour)
    exact = slosh_masses(_read(tmp_path))
    assert slosh_masses(by_points).kappa[0] == pytest.approx(exact.kappa[0], rel=1e-6)


def test_an_inner_wall_may_end_before_the_outer_one(tmp_path):
    contour = "z [m], r [m], z_inner [m], r_inner [m]\n0, 2.5, 0, 2.5\n5, 2.5, 1, 0\n10, 2.5, ,\n"
    tank = _read(tmp_path, (SHAPE, 'kind = "contour"\nfile = "c.csv"\n'), contour=contour)
    assert tank.section.volume == pytest.approx(np.pi * 2.5**2 * (6.2 - 1.0 / 3.0))


ONE_FAULT = {
    "percent without a sign": ('"6.2 m"', '"62"', 2, "fill", "has no unit"),
    "a bare number": ('"6.2 m"', "6.2", 2, "fill", "has no unit"),
    "above the top": ('"6.2 m"', '"10 m"', 2, "fill", "must be < 10 m"),
    "full": ('"6.2 m"', '"100 %"', 2, "fill", "must be > 0 and < 1"),
    "empty": ('"6.2 m"', '"0 m"', 2, "fill", "must be > 0 m"),
    "coast": ('"12.1 m/s^2"', '"0 m/s^2"', 3, "acceleration", "must be > 0 m/s^2"),
    "grams": ('"12.1 m/s^2"', '"1.2 g"', 3, "acceleration", "is a mass"),
    "no whole number": ("[liquid]", "modes = 1.5\n[liquid]", 5, "modes", "whole number"),
    "no density": ('density = "1141 kg/m^3"\n', "", 5, "liquid density", "is missing"),
    "no shape of ours": ('"cylinder"', '"cylnder"', 8, "shape kind", "is no shape"),
    "no kind": ('kind = "cylinder"\n', "", 7, "shape kind", "is missing"),
    "unknown key": ("[liquid]", "[liquid]\nviscosity = 3", 6, "liquid viscosity", "is an unknown key"),
    "negative radius": ('"2.5 m"', '"-2.5 m"', 9, "shape radius", "must be > 0 m"),
    "ring above the top": ('"5.9 m"', '"15 m"', 13, "baffle 1 height", "must be <= 10 m"),
    "a ring that is a bulkhead": ('"0.2 m"', '"2.6 m"', 14, "baffle 1 width", "must be < 2.5 m"),
    "no baffle of ours": ('"ring"', '"plate"', 12, "baffle 1 kind", "is no baffle"),
    "annulus inside out": (
        SHAPE,
        'kind = "annulus"\nradius = "1 m"\ninner_radius = "2 m"\nheight = "9 m"\n',
        10,
        "shape inner_radius",
        "must be < the radius",
    ),
}


@pytest.mark.parametrize("name", ONE_FAULT)
def test_one_fault_is_told_with_its_line(tmp_path, name):
    old, new, line, key, rule = ONE_FAULT[name]
    with pytest.raises(InputError) as caught:
        _read(tmp_path, (old, new))
    [problem] = caught.value.problems
    assert (problem.line, problem.key) == (line, key)
    assert rule in problem.rule
    assert problem.cure


CONTOURS = {
    "falling": ("z [m], r [m]\n0, 0\n1, 1\n0.5, 2\n", 4, "falls"),
    "open below": ("z [m], r [m]\n0, 1\n10, 1\n", 2, "open"),
    "negative radius": ("z [m], r [m]\n0, 0\n1, -1\n10, 2\n", 3, ">= 0"),
    "closed on the way": ("z [m], r [m]\n0, 0\n1, 1\n2, 0\n10, 2\n", 4, "closed"),
    "back on itself": ("z [m], r [m]\n0, 0\n1, 1\n1, 3\n1, 2\n10, 2\n", 5, "crosses itself"),
    "no unit": ("z, r\n0, 0\n1, 1\n", 1, "no unit"),
    "a word": ("z [m], r [m]\n0, 0\none, 1\n", 3, "must start with a number"),
    "inner wall outside": (
        "z [m], r [m], z_inner [m], r_inner [m]\n0, 0, 0, 0.5\n0, 2, 3, 2.5\n10, 2, 10, 1\n",
        3,
        "crosses itself",
    ),
    "inner wall open above": (
        "z [m], r [m], z_inner [m], r_inner [m]\n0, 2, 0, 0.5\n5, 2, 3, 0.5\n10, 2, ,\n",
        3,
        "open",
    ),
    "one height": ("z [m], r [m]\n1, 0\n1, 2\n", 3, "does not rise"),
}


@pytest.mark.parametrize("name", CONTOURS)
def test_a_contour_that_is_no_tank_is_told_with_its_line(tmp_path, name):
    contour, line, rule = CONTOURS[name]
    with pytest.raises(InputError) as caught:
        _read(tmp_path, (SHAPE, 'kind = "contour"\nfile = "c.csv"\n'), contour=contour)
    problem = caught.value.problems[0]
    assert problem.file.endswith("c.csv")
    assert problem.line == line
    assert rule in problem.rule


def test_all_faults_are_told_at_once(tmp_path):
    with pytest.raises(InputError) as caught:
        _read(tmp_path, ('"6.2 m"', '"62"'), ("radius", "raduis"), ('"0.2 m"', '"0.2 kg"'))
    assert [problem.line for problem in caught.value.problems] == [2, 7, 9, 14]


def test_the_shipped_tank_says_that_it_is_invented(tmp_path):
    path = write_example("lox_tank", tmp_path)
    assert "invented" in path.read_text(encoding="utf-8")
    found = slosh_masses(read_tank(path))
    assert len(found.kappa) == 2
    assert found.reasons == ()


def _case(folder: Path, tank_lines: str, tank: str = TANK) -> Path:
    (folder / "lox.toml").write_text(tank, encoding="utf-8")
    path = folder / "case.toml"
    path.write_text(GOOD.replace(OWN, tank_lines, 1), encoding="utf-8")
    return path


def test_a_case_takes_its_slosh_mass_from_a_tank_file_at_its_own_acceleration(tmp_path):
    case = read_case(_case(tmp_path, 'tank_file = "lox.toml"\n', TANK.replace("1141", "50")))
    lox = case.vehicle.tanks[0]
    found = slosh_masses(read_tank(tmp_path / "lox.toml"))
    a = 900e3 / 16000.0
    assert lox.frequency == pytest.approx(np.sqrt(a * found.kappa[0]))
    assert lox.slosh_mass == pytest.approx(found.slosh_mass[0])
    assert lox.station == pytest.approx(4.0 + found.spring_height[0])
    assert lox.radius == 2.5
    assert case.source is not None
    assert "not the tank file's 12.1 m/s^2" in case.source.notes[0]
    assert any("sha256" in key for key in case.source.given)


def _undamped(folder: Path, tank_lines: str = 'tank_file = "lox.toml"\n', tank: str = TANK) -> Path:
    path = _case(folder, tank_lines, tank.replace("1141", "50"))
    text = path.read_text(encoding="utf-8")
    assert f"damping = {POWER}\n" in text
    path.write_text(text.replace(f"damping = {POWER}\n", "", 1), encoding="utf-8")
    return path


VISCOUS = TANK.replace("[liquid]\n", '[liquid]\nkinematic_viscosity = "0.17 cSt"\n')


def test_a_case_takes_its_damping_from_a_tank_file_and_says_by_which_formulas(tmp_path):
    """Wall and ring by hand, at the case's own acceleration of 56.25 m/s^2: R 2.5 m, h 6.2 m, d 0.3 m, w 0.2 m."""
    case = read_case(_undamped(tmp_path, tank=VISCOUS))
    law = case.vehicle.tanks[0].damping
    wall = min(f(1.7e-7, 2.5, 56.25, 6.2) for f in (mikishev_cylinder, stephens_cylinder))
    A, wave = 0.05, 2.0 * 1.8411838 / (1.8411838**2 - 1.0) * np.tanh(1.8411838 * 2.48)
    ring = 2.83 * np.exp(-4.6 * 1.55 * 0.12) * (0.08 * 1.92) ** 1.5 * np.sqrt(wave * A / 2.5)
    assert float(law.ratio(0.0)) == pytest.approx(wall, rel=1e-9)
    assert float(law.ratio(A)) == pytest.approx(wall + ring, rel=1e-6)
    assert law.largest_amplitude == pytest.approx(0.25 / wave, rel=1e-6)
    assert np.isnan(law.ratio(0.17))
    assert case.source is not None
    notes = "\n".join(case.source.notes)
    assert "LOX: damping at any amplitude 0.00" in notes
    assert "smooth wall by " in notes
    assert "Coogan and Green" in notes
    assert "slosh-mass displacement in m, to 0.162" in notes
    again = read_case(write_case(case, tmp_path / "again.toml"))
    assert again.vehicle.tanks[0].damping == law
    assert any("Coogan and Green" in reason for reason in assess(case).reasons)


def test_rings_alone_a_floor_alone_and_the_second_mode_damp_a_case(tmp_path):
    ring = read_case(_undamped(tmp_path)).vehicle.tanks[0].damping
    assert isinstance(ring, PowerDamping)
    bare = TANK[: TANK.index("[[baffle]]")]
    floor = 'damping_floor = "0.2 %"\n' + bare
    assert read_case(_undamped(tmp_path, tank=floor)).vehicle.tanks[0].damping == ConstantDamping(ratio=0.002)
    second = read_case(_undamped(tmp_path, 'tank_file = "lox.toml"\nmode = 2\n', 'damping_floor = "0.2 %"\n' + VISCOUS))
    law = second.vehicle.tanks[0].damping
    assert isinstance(law, ConstantDamping)
    assert law.constant_ratio < 1e-4
    assert second.source is not None
    assert any("left out of mode 2" in note for note in second.source.notes)


def test_damping_in_the_case_goes_before_the_tank_files_and_is_noted(tmp_path):
    case = read_case(_case(tmp_path, 'tank_file = "lox.toml"\n', VISCOUS.replace("1141", "50")))
    assert case.vehicle.tanks[0].damping == PowerDamping(slope=0.1)
    assert case.source is not None
    assert "LOX: damping as the case gives it, not by the formulas of the tank file" in case.source.notes


@pytest.mark.parametrize(
    ("tank", "why"),
    [
        (TANK[: TANK.index("[[baffle]]")], "is missing, and the tank file gives none"),
        (TANK.replace('"5.9 m"', '"7 m"'), "gives none: baffles: no ring baffle is wet"),
        (TANK.replace('"0.2 m"', '"0.9 m"'), "gives none: baffles: the ring of 5.9 m is wider"),
    ],
)
def test_a_tank_file_without_damping_leaves_the_case_without_and_says_why(tmp_path, tank, why):
    with pytest.raises(InputError) as caught:
        read_case(_undamped(tmp_path, tank=tank))
    [problem] = caught.value.problems
    assert why in problem.rule
    assert problem.key == 'tank "LOX" damping'
    assert problem.line is not None
    assert "damping_floor" in problem.cure


def test_a_refused_tank_file_does_not_make_the_case_miss_damping_too(tmp_path):
    for lines, tank in (
        ('tank_file = "no.toml"\n', TANK),
        ('tank_file = "lox.toml"\n', TANK.replace('"6.2 m"', '"62"')),
    ):
        with pytest.raises(InputError) as caught:
            read_case(_undamped(tmp_path, lines, tank))
        assert len(caught.value.problems) == 1


def test_a_case_may_take_the_second_slosh_mass(tmp_path):
    case = read_case(_case(tmp_path, 'tank_file = "lox.toml"\nmode = 2\n', TANK.replace("1141", "50")))
    found = slosh_masses(read_tank(tmp_path / "lox.toml").model_copy(update={"modes": 2}))
    assert case.vehicle.tanks[0].slosh_mass == pytest.approx(found.slosh_mass[1])


@pytest.mark.parametrize(
    ("lines", "tank", "file", "rule"),
    [
        ('tank_file = "lox.toml"\n', TANK.replace('bottom_station = "4 m"\n', ""), "case.toml", "bottom_station"),
        ('tank_file = "no.toml"\n', TANK, "case.toml", "does not exist"),
        ('tank_file = "../lox.toml"\n', TANK, "case.toml", "leads out"),
        ("tank_file = 3\n", TANK, "case.toml", "must be a text"),
        ('tank_file = "lox.toml"\nmode = 0\n', TANK, "case.toml", "whole number"),
        ('tank_file = "lox.toml"\nstation = "9 m"\n', TANK, "case.toml", "stands beside station"),
        ('tank_file = "lox.toml"\n', TANK.replace('"6.2 m"', '"62"'), "lox.toml", "has no unit"),
    ],
)
def test_a_tank_file_that_does_not_serve_a_case_is_told_once(tmp_path, lines, tank, file, rule):
    with pytest.raises(InputError) as caught:
        read_case(_case(tmp_path, lines, tank))
    [problem] = caught.value.problems
    assert problem.file.endswith(file)
    assert rule in problem.rule


def test_names_follow_the_rule_of_the_vehicles_tanks():
    assert NAME == slosh_mass.NAME


def test_a_fill_history_goes_through_files_and_equals_single_fills(tmp_path):
    tank = _read(tmp_path)
    path = tmp_path / "fills.csv"
    path.write_text("time [s], fill [%], acceleration [m/s^2]\n0, 90, 10\n60, 35, 20\n90, 0, 25\n", encoding="utf-8")
    rows = read_fill_table(path)
    course = slosh_masses_history(tank, rows.fill, rows.acceleration, rows.time)
    for k, (depth, a) in enumerate([(9.0, 10.0), (3.5, 20.0)]):
        single = slosh_masses(_read(tmp_path, ('"6.2 m"', f'"{depth} m"'), ('"12.1', f'"{a}')))
        assert course.of_modes("frequency")[k, 0] == pytest.approx(single.frequency[0])
        assert course.of_tank("fixed_mass")[k] == pytest.approx(single.fixed_mass)
    assert np.isnan(course.depth[2])
    assert "must be > 0" in course.reason[2]
    assert "1 without slosh masses" in str(course)
    table = write_fill_history(course, tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    head = table[0].split(",")
    assert {"time [s]", "frequency_1 [rad/s]", "station_1 [m]", "reason"} <= set(head)
    assert float(table[1].split(",")[head.index("slosh_mass_1 [kg]")]) == course.of_modes("slosh_mass")[0, 0]

    import xarray as xr

    assert course.of_damping("wall_damping")[:2] == pytest.approx([np.nan] * 2, nan_ok=True)  # no viscosity is given
    rings = [tank_damping(row).baffles for row in course.rows[:1] if row is not None]
    assert rings[0] is not None
    assert course.of_damping("ring_coefficient")[0] == rings[0].law.slope
    assert np.isnan(course.of_damping("ring_coefficient")[1])  # at 3.5 m the ring is dry
    assert "no ring baffle is wet" in table[2]
    with xr.open_dataset(write_fill_history(course, tmp_path / "out.nc"), engine="h5netcdf") as back:
        np.testing.assert_array_equal(back["spring_height"].values, course.of_modes("spring_height"))
        assert back["frequency"].attrs["units"] == "rad/s"


@pytest.mark.parametrize(
    ("text", "line", "rule", "cure"),
    [
        ("time [s], acceleration [m/s^2]\n0, 1\n1, 2\n", 1, "has not one of", "write the header"),
        ("time [s], fill [%]\n0, 1\n0, 2\n", 3, "do not increase: 0 s follows 0 s", "sort the rows"),
        ("time [s], fill [%]\n0, 1\n5, 2\n4, 3\n", 4, "do not increase: 4 s follows 5 s", "sort the rows"),
        ("fill [%], acceleration [m/s^2]\n1, 1\n2, \n", 1, "blank", "fill the cells"),
        ("time [s], fill\n0, 50\n1, 40\n", 1, "has no unit for the fill", "fill [%]"),
        ("time [s], fill []\n0, 50\n1, 40\n", 1, "has no unit for the fill", "fill [%]"),
    ],
)
def test_a_fill_history_that_is_none_is_refused(tmp_path, text, line, rule, cure):
    path = tmp_path / "fills.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_fill_table(path)
    assert caught.value.problems[0].line == line
    assert rule in caught.value.problems[0].rule
    assert cure in caught.value.problems[0].cure


def test_a_fill_of_one_is_the_plain_number_that_its_header_says(tmp_path):
    path = tmp_path / "fills.csv"
    path.write_text("fill [1]\n0.5\n0.25\n", encoding="utf-8")
    assert read_fill_table(path).fill == ("50.0 %", "25.0 %")


@pytest.mark.parametrize(
    ("radius", "refused"), [("2.5 m", False), ("2500.4 mm", False), ("25 m", True), ("2.4 m", True)]
)
def test_a_radius_beside_a_tank_file_is_that_of_its_surface(tmp_path, radius, refused):
    path = _case(tmp_path, 'tank_file = "lox.toml"\n', TANK.replace("1141", "50"))
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("radius = ")]
    at = lines.index('tank_file = "lox.toml"') + 1
    path.write_text("\n".join([*lines[:at], f'radius = "{radius}"', *lines[at:]]) + "\n", encoding="utf-8")
    if not refused:
        assert read_case(path).vehicle.tanks[0].radius == pytest.approx(2.5, rel=1e-3)
        return
    with pytest.raises(InputError) as caught:
        read_case(path)
    [problem] = caught.value.problems
    assert (problem.file, problem.line) == (str(path), at + 1)
    assert radius in problem.value
    assert "is not 2.5 m" in problem.rule
    assert problem.cure == "leave it out"


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ('"12.1 m/s^2"', '"1e-4 m/s^2"', "the Bond number may be as low as 8.9"),  # 1e-4 * 2.5^2 / 7e-5
        ('"12.1 m/s^2"', '"1.1e-3 m/s^2"', "the Bond number may be as low as 98"),
        ('"12.1 m/s^2"', '"1.2e-3 m/s^2"', None),
        ('"6.2 m"', '"20 mm"', "a depth of 0.02 m is 0.8 % of the surface's radius"),
        ('"6.2 m"', '"30 mm"', None),
        ('"1141 kg/m^3"', '"1.141 kg/m^3"', "a density of 1.141 kg/m^3 is that of no propellant"),
        ('"1141 kg/m^3"', '"69 kg/m^3"', "a density of 69 kg/m^3"),
        ('"1141 kg/m^3"', '"70.8 kg/m^3"', None),
        ('"1141 kg/m^3"', '"2100 kg/m^3"', "a density of 2100 kg/m^3"),
    ],
)
def test_a_doubtful_tank_is_cautioned_about(tmp_path, old, new, word):
    found = slosh_masses(_read(tmp_path, (old, new)))
    cautions = [reason for reason in found.reasons if reason.startswith("caution")]
    if word is None:
        assert cautions == []
    else:
        assert len(cautions) == 1
        assert word in cautions[0]
        assert cautions[0] in str(found)
        assert cautions[0] in str(slosh_masses_history(found.tank, [found.tank.fill]))


@pytest.mark.parametrize("fill", ["1e-9 m", "0.00001 %"])
def test_a_film_is_no_liquid_that_sloshes(tmp_path, fill):
    with pytest.raises(InputError) as caught:
        _read(tmp_path, ('"6.2 m"', f'"{fill}"'))
    [problem] = caught.value.problems
    assert (problem.line, problem.key) == (2, "fill")
    assert "must be >= 0.1 mm deep" in problem.rule
