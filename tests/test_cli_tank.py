"""The tank command: prints, draws, and refuses in the one error form with exit status 2."""

import json

import pytest

from sloshpy.files import read_tank, write_example
from sloshpy.tank import slosh_masses


@pytest.fixture
def tank(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_example("lox_tank", tmp_path)


def test_tank_prints_its_slosh_masses_and_draws_its_section(run, tank):
    status, out, err = run("tank", tank)
    assert (status, err) == (0, "")
    assert "spring m" in out
    assert "hinge m" in out
    assert tank.with_name("lox_tank-tank.png").stat().st_size > 10_000


def test_tank_json_has_the_keys_of_the_contract_and_draws_only_where_asked(run, tank):
    status, out, _ = run("tank", tank, "--json")
    said, found = json.loads(out), slosh_masses(read_tank(tank))
    assert status == 0
    assert not tank.with_name("lox_tank-tank.png").exists()
    assert {
        "name", "liquid_mass", "liquid_cg_height", "surface_radius", "depth", "modes", "fixed_mass",
        "fixed_mass_height", "fixed_mass_inertia", "rigid_lid_inertia", "wall_damping", "baffle_damping",
        "wall_damping_formula", "damping_floor",
    } <= set(said)  # fmt: skip
    assert set(said["modes"][0]) == {
        "kappa", "frequency_hz", "slosh_mass", "spring_height", "hinge_height", "pendulum_length",
        "wave_per_displacement", "station", "error_estimate",
    }  # fmt: skip
    assert said["modes"][1]["slosh_mass"] == found.slosh_mass[1]
    assert said["modes"][0]["station"] == 5.5 + found.spring_height[0]
    run("tank", tank, "--json", "-o", "section.svg")
    assert tank.with_name("section.svg").exists()


def test_tank_draws_its_damping_where_asked_and_says_where_there_is_none(run, tank):
    status, out, _ = run("tank", tank, "--damping-figure", "damping.png")
    assert status == 0
    assert "boundary layer x 1.42" in out
    assert tank.with_name("damping.png").stat().st_size > 10_000
    text = tank.read_text(encoding="utf-8")
    tank.write_text(text.replace('kinematic_viscosity = "1.7e-7 m^2/s"\n', ""), encoding="utf-8")
    status, _, err = run("tank", tank, "--damping-figure", "none.png")
    assert status == 2
    assert "has nothing to show: neither viscosity nor ring baffle nor damping_floor" in err
    assert not tank.with_name("none.png").exists()


def test_tank_follows_a_history_into_a_table(run, tank):
    tank.with_name("fills.csv").write_text("time [s], fill [%]\n0, 90\n50, 40\n", encoding="utf-8")
    status, out, _ = run("tank", tank, "--history", "fills.csv", "--table", "out.csv")
    assert status == 0
    assert "2 rows, 0 without" in out
    assert tank.with_name("out.csv").read_text(encoding="utf-8").count("\n") == 3
    assert tank.with_name("lox_tank-history.png").exists()


def test_a_history_in_which_no_row_works_is_refused_and_draws_nothing(run, tank):
    tank.with_name("fills.csv").write_text("time [s], fill [%]\n0, 100\n50, 0\n", encoding="utf-8")
    status, out, err = run("tank", tank, "--history", "fills.csv", "--table", "out.csv")
    assert (status, out) == (2, "")
    assert "has no row with slosh masses; row 1: fill must be > 0 and < 1" in err
    assert not tank.with_name("out.csv").exists()
    assert not tank.with_name("lox_tank-history.png").exists()


def test_a_history_says_how_many_of_its_rows_failed(run, tank):
    tank.with_name("fills.csv").write_text("fill [%]\n" + "100\n" * 6 + "50\n", encoding="utf-8")
    status, out, _ = run("tank", tank, "--history", "fills.csv")
    assert status == 0
    assert "7 rows, 6 without slosh masses" in out
    assert "  - row 5: fill must be > 0 and < 1\n  - and 1 more\n" in out


def test_a_history_that_no_tank_can_have_is_refused_cell_by_cell_and_nothing_is_written(run, tank):
    rows = "time [s], fill [%], acceleration [m/s^2]\n0, 90, 12\n1, 120, 12\n2, -3, 0\n3, 40, -12\n"
    tank.with_name("fills.csv").write_text(rows, encoding="utf-8")
    status, out, err = run("tank", tank, "--history", "fills.csv", "--table", "out.csv")
    assert (status, out) == (2, "")
    told = [line for line in " ".join(err.split()).split("fills.csv:") if "column" in line]
    assert [int(line.split(":")[0]) for line in told] == [3, 4, 4, 5]
    assert "column fill: 120 [%]; must be >= 0 % and <= 100 % of the volume. Cure: half is 50" in told[0]
    assert "column fill: -3 [%]" in told[1]
    assert "column acceleration: 0 [m/s^2]; must be > 0 m/s^2. Cure: drop the row" in told[2]
    assert "column acceleration: -12 [m/s^2]" in told[3]
    tank.with_name("fills.csv").write_text("depth [m]\n2\n9\n", encoding="utf-8")
    status, out, err = run("tank", tank, "--history", "fills.csv", "--table", "out.csv")
    assert (status, out) == (2, "")
    assert "fills.csv:3: column depth: 9 [m]; must be >= 0 m and <= 4.6 m, the height of the tank" in err
    assert not tank.with_name("out.csv").exists()
    assert not tank.with_name("lox_tank-history.png").exists()


@pytest.mark.parametrize("rows", ["fill [%]\n0\n50\n100\n", "depth [m]\n0\n2\n4.6\n", "depth [mm]\n0.01\n2000\n4600\n"])
def test_an_empty_and_a_full_tank_are_rows_without_slosh_masses(run, tank, rows):
    tank.with_name("fills.csv").write_text(rows, encoding="utf-8")
    status, out, err = run("tank", tank, "--history", "fills.csv", "--table", "out.csv")
    assert (status, err) == (0, "")
    assert "3 rows, 2 without slosh masses" in out
    assert tank.with_name("out.csv").read_text(encoding="utf-8").count("\n") == 4


def test_schema_prints_that_of_the_file_asked_for(run):
    for words, title in (((), "slosh case"), (("case",), "slosh case"), (("tank",), "slosh tank")):
        status, out, err = run("schema", *words)
        assert (status, err) == (0, "")
        assert json.loads(out)["title"] == title
    status, out, err = run("schema", "tnak")
    assert (status, out) == (2, "")
    assert "tnak" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("no.toml",), "does not exist"),
        (("lox_tank.toml", "--damping-figure", "x.doc"), "must end in"),
        (("lox_tank.toml", "--damping-figure", "x.png", "--history", "lox_tank.toml"), "stands beside --history"),
        (("lox_tank.toml", "--table", "x.csv"), "needs --history"),
        (("lox_tank.toml", "-o", "x.jpg"), "must end in"),
        (("lox_tank.toml", "--history", "lox_tank.toml", "--table", "x.doc"), "must end in"),
        (("lox_tank.toml", "-o", "lox_tank.toml"), "must end in"),
    ],
)
def test_tank_refuses_with_status_2(run, tank, words, said):
    status, out, err = run("tank", *words)
    assert (status, out) == (2, "")
    assert said in err
