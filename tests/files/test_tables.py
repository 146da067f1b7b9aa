"""A damping table is read strictly: one header, one number grammar, no silent gaps."""

from pathlib import Path

import numpy as np
import pytest

from sloshpy.errors import InputError
from sloshpy.files import read_damping_table

HEADER = 'write the header "amplitude [m], ratio [%]"'
NUMBER = "write a number with a decimal point"
CELLS = "separate cells by commas, write decimal points, and fill every cell"


@pytest.mark.parametrize(
    ("text", "amplitude", "ratio"),
    [
        ("amplitude [m], ratio [%]\n0, 0.2\n0.1, 1.2\n", [0.0, 0.1], [0.002, 0.012]),
        ("# a test\namplitude [in],ratio\n\n0,2e-3  # wall\n10,.012", [0.0, 0.254], [0.002, 0.012]),
        ("ratio [1],amplitude [mm]\n0.1,0\n0.2,5", [0.0, 0.005], [0.1, 0.2]),
        ("\ufeffamplitude [m],ratio\r\n0,0.1\r\n1,0.2\r\n", [0.0, 1.0], [0.1, 0.2]),
    ],
)
def test_a_table_is_read_in_si(tmp_path: Path, text: str, amplitude: list[float], ratio: list[float]) -> None:
    path = tmp_path / "d.csv"
    path.write_bytes(text.encode())
    read = read_damping_table(path)
    np.testing.assert_allclose(read[0], amplitude, rtol=1e-15)
    np.testing.assert_allclose(read[1], ratio, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "line", "key", "value", "rule", "cure"),
    [
        ("0,1\n2,3", 1, "header", "0, 1", "is not a header", HEADER),
        ("amplitude,ratio\n0,1", 1, "header", "amplitude, ratio", "has no unit for the amplitude", HEADER),
        ("amplitude [kg],ratio\n", 1, "header", "amplitude [kg], ratio", "[kg] is a mass, must be a length", HEADER),
        ("amplitude [m]\n0", 1, "header", "amplitude [m]", 'has no column "ratio"', HEADER),
        ("amplitude [m],x\n", 1, "header", "amplitude [m], x", 'has the unknown column "x"', HEADER),
        ("ratio,ratio\n", 1, "header", "ratio, ratio", 'has the column "ratio" twice', HEADER),
        (
            "amplitude [m];ratio\n0;0,1",
            1,
            "header",
            "amplitude [m];ratio",
            "is separated by semicolons",
            "separate the cells by commas, with decimal points in them",
        ),
        ("amplitude [m],ratio\n", 1, "damping table", "", "has 0 data rows", "give at least two"),
        ("amplitude [m],ratio\n0,1,2\n", 2, "row", "0, 1, 2", "has 3 cells where the header has 2", CELLS),
        ("amplitude [m],ratio\n0\n", 2, "row", "0", "has 1 cells where the header has 2", CELLS),
        ("amplitude [m],ratio\n0,\n", 2, "column ratio", "", "is blank", "fill the cell or drop the row"),
        ("amplitude [m],ratio\nabc,0\n", 2, "column amplitude", "abc", "must start with a number", NUMBER),
        ("amplitude [m],ratio\n#N/A,0\n", 2, "column amplitude", "#N/A", "must start with a number", NUMBER),
        ('amplitude [m],ratio\n"0,5",0\n', 2, "column amplitude", "0,5", "is not one plain number", NUMBER),
        (
            "amplitude [m],ratio\n1.0D+00,0\n",
            2,
            "column amplitude",
            "1.0D+00",
            "has a Fortran exponent",
            "write e in place of D, as in 1.0e3",
        ),
        ("amplitude [m],ratio\nnan,0\n", 2, "column amplitude", "nan", "must be finite", NUMBER),
        ("amplitude [m],ratio\n0,-inf\n", 2, "column ratio", "-inf", "must be finite", NUMBER),
        (
            "amplitude [m],ratio\n0,5 %\n",
            2,
            "column ratio",
            "5 %",
            "has a unit in the cell",
            "write the unit into the header only",
        ),
        (
            "amplitude [m],ratio\n0,0\n# x\n2,0\n1,0\n",
            5,
            "column amplitude",
            "1",
            "must increase, but 1 m follows 2 m",
            "sort the rows",
        ),
        (
            "amplitude [m],ratio\n-1,0\n2,0\n",
            2,
            "column amplitude",
            "-1",
            "must be >= 0 m and <= 1000 m",
            "drop the sign",
        ),
        (
            "amplitude [m],ratio\n0,0\n2,4.8\n",
            3,
            "column ratio",
            "4.8",
            "must be >= 0 and <= 0.3",
            'a damping ratio above 0.3 is not slosh; a percentage is written "4.8 %"',
        ),
        (
            "amplitude [m],ratio\n0,0\n",
            2,
            "column amplitude",
            "",
            "has 1 row",
            'give at least two, or use law = "constant"',
        ),
    ],
)
def test_a_fault_of_a_table_is_told_with_row_and_column(
    tmp_path: Path, text: str, line: int, key: str, value: str, rule: str, cure: str
) -> None:
    path = tmp_path / "d.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_damping_table(path)
    [problem] = caught.value.problems
    assert (problem.line, problem.key, problem.value, problem.rule, problem.cure) == (line, key, value, rule, cure)
    assert problem.file == str(path)


def test_every_fault_of_a_table_is_told(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text("amplitude [m],ratio\nx,y\n0,0,0\n1,\n")
    with pytest.raises(InputError) as caught:
        read_damping_table(path)
    assert [(p.line, p.key) for p in caught.value.problems] == [
        (2, "column amplitude"),
        (2, "column ratio"),
        (3, "row"),
        (4, "column ratio"),
    ]


def test_what_is_no_table_is_one_problem(tmp_path: Path) -> None:
    for content, rule in [
        (b"", "is empty"),
        (b"# nothing\n", "has no header"),
        (b"amplitude [m],ratio\n0,\xff\n", "is not UTF-8 text at byte 22"),
        (b"amplitude [m],ratio\n" + b"0,0\n" * 10_001, "has 10001 rows, more than 10000"),
        (b"amplitude [m],ratio\n" + b"9" * 200_000 + b",0\n", "has 1 cells where the header has 2"),
    ]:
        path = tmp_path / "d.csv"
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            read_damping_table(path)
        assert [p.rule for p in caught.value.problems] == [rule]
