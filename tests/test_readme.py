"""What the README shows is what the package says."""

import re
from pathlib import Path

from sloshpy.assess import assess
from sloshpy.files import case_schema, read_case
from sloshpy.files.examples import write_example

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
