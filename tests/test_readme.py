"""What the README shows is what the package says."""

import re
import tomllib
from pathlib import Path

import pytest

from sloshpy.assess import assess
from sloshpy.files import case_schema, read_case, read_tank, tank_schema
from sloshpy.files.examples import write_example
from sloshpy.tank import Tank

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.M | re.S)


def test_the_output_shown_is_the_output_of_the_example(tmp_path: Path) -> None:
    shown = blocks("")[0].rstrip()
    said = str(assess(read_case(write_example("upper_stage", tmp_path))))
    assert [line.rstrip() for line in shown.splitlines()] == [line.rstrip() for line in said.splitlines()]


def test_the_case_shown_is_a_valid_case(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(blocks("toml")[0], encoding="utf-8")
    case = read_case(path)
    assert abs(case.vehicle.mass - 16000.0) < 1.0
    assert set(case.source.given) >= {"vehicle.mass", "tank.LOX.frequency"}
    assert "tank" in case_schema()["properties"]


def test_the_tanks_shown_are_valid_and_show_every_key(tmp_path: Path) -> None:
    (tmp_path / "contour.csv").write_text("z [m], r [m]\n0, 0\n0.3, 1.6\n4, 1.6\n", encoding="utf-8")
    text = blocks("toml")[1]
    (taken,) = re.findall(r"^shape = .*\n", text, flags=re.M)
    others = re.findall(r"^# (shape = .*\n)", text, flags=re.M)
    shown: dict[str, set[str]] = {}
    for shape in (taken, *others):
        path = tmp_path / "tank.toml"
        path.write_text(text.replace(taken, shape), encoding="utf-8")
        assert read_tank(path).shape.kind in shape
        keys = tomllib.loads(shape)["shape"]
        shown.setdefault(keys["kind"], set()).update(keys)
    known = tank_schema()["properties"]
    of_shape = {one["properties"]["kind"]["enum"][0]: set(one["properties"]) for one in known["shape"]["oneOf"]}
    assert {kind: of_shape[kind] - keys for kind, keys in shown.items()} == {
        kind: {"z_inner", "r_inner"} if kind == "contour" else set() for kind in of_shape
    }
    whole = tomllib.loads(text)
    assert set(whole) == set(known)
    assert set(whole["liquid"]) == set(known["liquid"]["properties"])
    assert set(whole["baffle"][0]) == set(known["baffle"]["items"]["properties"])


def test_an_open_top_is_taken_as_a_flat_lid_as_said() -> None:
    assert "taken as closed by a flat lid" in README
    shapes = [{"kind": "contour", "z": [0, 0, 4], "r": [0, 1, 1]}, {"kind": "cylinder", "radius": 1, "height": 4}]
    contour, cylinder = (
        Tank(name="T", fill="90 %", acceleration=9.81, liquid={"density": 1e3}, shape=shape) for shape in shapes
    )
    assert contour.volume == pytest.approx(cylinder.volume)
    assert contour.depth == pytest.approx(3.6)
    with pytest.raises(ValueError, match="no free surface is left"):
        Tank(name="T", fill=4.0, acceleration=9.81, liquid={"density": 1e3}, shape=shapes[0])


def test_the_python_shown_runs(tmp_path: Path, monkeypatch) -> None:
    write_example("upper_stage", tmp_path)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(blocks("python")[0], "README", "exec"), names)
    assert names["swept"].nichols_disc_margin.shape == (50,)
    assert abs(names["history"].slosh_envelope().amplitude - 0.4436) < 2e-3


def test_the_images_shown_are_there() -> None:
    for image in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert (Path(__file__).parents[1] / image).stat().st_size > 10_000
