"""The concordance with the paper names functions and tests that exist."""

import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROWS = [
    line
    for line in (ROOT / "docs" / "paper.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and "`" in line and "test_" in line
]
EQUATIONS = set(range(1, 25))


def test_the_concordance_has_rows() -> None:
    assert len(ROWS) >= 20


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.split("|")[1].strip())
def test_every_row_names_a_function_a_test_and_a_figure_that_exist(row: str) -> None:
    cells = [cell.strip().strip("`") for cell in row.strip("|").split("|")]
    _, function, test, figure = cells
    for name in filter(None, (function, figure if "." in figure else "")):
        module, attribute = name.rsplit(".", 1)
        assert callable(getattr(import_module(f"sloshpy.{module}"), attribute))
    file, name = test.split("::")
    text = (ROOT / "tests" / file).read_text(encoding="utf-8")
    assert re.search(rf"^def {name}\(", text, flags=re.M), test


def test_every_numbered_equation_has_a_row() -> None:
    named: set[int] = set()
    for row in ROWS:
        for first, last in re.findall(r"eqs? (\d+)(?:-(\d+))?", row.split("|")[1]):
            named |= set(range(int(first), int(last or first) + 1))
    assert named == EQUATIONS


@pytest.mark.parametrize("figure", [4, 5, 6, 7, 8, 9])
def test_every_result_figure_of_the_paper_is_drawn(figure: int) -> None:
    drawn = [row for row in ROWS if re.search(rf"fig {figure}\b", row.split("|")[1]) and "plots." in row]
    assert drawn
