"""Time histories are read strictly from four formats: units declared, no gaps filled, no objects, no broken files."""

import time as clock
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
from scipy.io import netcdf_file, savemat

from sloshpy.errors import InputError
from sloshpy.files import read_time_history

TIME = np.array([0.0, 0.1, 0.2, 0.35])
WAVE = np.array([10.0, -5.0, 2.5, 1e-3])  # mm


def csv(path: Path) -> None:
    path.write_text(
        "# a test\ntime [s], wave [mm], note\n0,10,a\n0.1,-5, b # c\n\n0.2,2.5,\n.35,1e-3,d\n", encoding="utf-8"
    )


def xlsx(path: Path, rows=None) -> None:
    book = openpyxl.Workbook()
    for row in (("time [s]", "wave [mm]"), *(rows or zip(TIME.tolist(), WAVE.tolist(), strict=True))):
        book.active.append(row)
    book.save(path)


def mat5(path: Path, **more) -> None:
    savemat(path, {"time": TIME, "time_unit": "s", "wave": WAVE[:, None], "wave_unit": "mm"} | more)


def mat7(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"] = TIME[None]
        file["time"].attrs["units"] = "s"
        file["wave"] = WAVE[None].astype(">f8")
        file["wave"].attrs["MATLAB_class"] = np.bytes_(b"double")
        file["wave_unit"] = np.array([[ord("m")], [ord("m")]], dtype=np.uint16)
    with open(path, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def nc4(path: Path, values=WAVE, **attributes) -> None:
    with h5py.File(path, "w") as file:
        for name, numbers, units in (("time", TIME, "s"), ("wave", values, "mm")):
            file.create_dataset(name, data=numbers)
            file[name].attrs["units"] = units
        for key, value in attributes.items():
            file["wave"].attrs[key] = value


def nc3(path: Path) -> None:
    with netcdf_file(path, "w") as file:
        file.createDimension("time", 4)
        for name, numbers, units in (("time", TIME, "s"), ("wave", WAVE, "mm")):
            file.createVariable(name, "d", ("time",))[:] = numbers
            file.variables[name].units = units


FORMATS = [
    ("t.csv", csv),
    ("t.xlsx", xlsx),
    ("five.mat", mat5),
    ("seven.mat", mat7),
    ("four.nc", nc4),
    ("three.nc", nc3),
]


@pytest.mark.parametrize(("name", "write"), FORMATS, ids=[name for name, _ in FORMATS])
def test_a_record_is_read_in_si(tmp_path: Path, name: str, write) -> None:
    write(tmp_path / name)
    record = read_time_history(tmp_path / name, "wave")
    np.testing.assert_array_equal(record.time, TIME)
    np.testing.assert_allclose(record.value, 1e-3 * WAVE, rtol=1e-15)
    assert (record.unit, record.column, record.file) == ("m", "wave", str(tmp_path / name))


@pytest.mark.parametrize(("name", "write"), FORMATS, ids=[name for name, _ in FORMATS])
def test_a_truncated_file_and_a_missing_column_are_refused(tmp_path: Path, name: str, write) -> None:
    path = tmp_path / name
    write(path)
    with pytest.raises(InputError, match=r'wve; is not in the file\. Cure: did you mean "wave"'):
        read_time_history(path, "wve")
    whole = path.read_bytes()
    for part in (0.3, 0.6, 0.9) if name != "t.csv" else (0.3, 0.885):  # a CSV cut between two rows is a shorter one
        path.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(InputError):
            read_time_history(path, "wave")


def test_a_force_and_other_units_of_time_are_read(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("t [ms], load cell [lbf]\n0, 1\n100, -1\n200, 0.5\n", encoding="utf-8")
    record = read_time_history(path, "load cell", time_column="t")
    np.testing.assert_allclose(record.time, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(record.value, 4.4482216152605 * np.array([1.0, -1.0, 0.5]))
    assert record.unit == "N"


@pytest.mark.parametrize(
    ("text", "line", "key", "rule"),
    [
        ("", None, "time history", "is empty"),
        ("# x\n", None, "time history", "has no header"),
        ("time [s], wave [mm]\n", 1, "time history", "has 0 data rows"),
        ("0, 1\n2, 3\n", 1, "header", "is not a header"),
        ("time [s];wave [mm]\n0;1\n", 1, "header", "is separated by semicolons"),
        ("time [s], wave\n0, 1\n1, 2\n", 1, "column wave", "has no unit"),
        ("time, wave [mm]\n0, 1\n1, 2\n", 1, "column time", "has no unit"),
        ("time [s], wave [kg]\n0, 1\n1, 2\n", 1, "column wave", "is no length or force"),
        ("time [s], wave [mmm]\n0, 1\n1, 2\n", 1, "column wave", 'has the unknown unit "mmm"'),
        ("time [m], wave [mm]\n0, 1\n1, 2\n", 1, "column time", "is no time"),
        ("time [s], wave [mm], wave [m]\n0, 1, 1\n1, 2, 2\n", 1, "header", "is there twice"),
        ("time [s], wave [mm]\n0, 1\n1, abc\n", 3, "column wave", "must start with a number"),
        ("time [s], wave [mm]\n0, 1\n1, \n", 3, "column wave", "is blank"),
        ("time [s], wave [mm]\n0, 1\n1, nan\n", 3, "column wave", "must be finite"),
        ("time [s], wave [mm]\n0, 1\n1, #N/A\n", 3, "column wave", "must start with a number"),
        ("time [s], wave [mm]\n0, 1\n1, 1.0D+03\n", 3, "column wave", "has a Fortran exponent"),
        ("time [s], wave [mm]\n0, 1\n1, 2 mm\n", 3, "column wave", "has a unit in the cell"),
        ("time [s], wave [mm]\n0, 1\n1, 1e999\n", 3, "column wave", "must be finite"),
        ("time [s], wave [mm]\n0, 1\n1, 2, 3\n", 3, "row", "has 3 cells where the header has 2"),
        ("time [s], wave [mm]\n0, 1\n1\n", 3, "row", "has 1 cells where the header has 2"),
        ("time [s], wave [mm]\n0, 1\n0,5, 2\n", 3, "row", "has 3 cells where the header has 2"),
        ("time [s], wave [mm]\n0, 1\n1, 2\n# x\n1, 3\n", 5, "column time", "must increase"),
        ("time [s], wave [mm]\n0, 1\n[s], [mm]\n1, 3\n", 3, "column time", "must start with a number"),
    ],
)
def test_a_fault_is_told_with_its_place(tmp_path: Path, text: str, line: int | None, key: str, rule: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_time_history(path, "wave")
    problem = caught.value.problems[0]
    assert (problem.file, problem.line, problem.key, problem.rule) == (str(path), line, key, rule)
    assert problem.cure


def test_every_fault_of_a_table_is_told_at_once(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("time [s], wave [mm]\n0, x\n1, 2\ny, 3\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_time_history(path, "wave")
    assert [(p.line, p.key) for p in caught.value.problems] == [(2, "column wave"), (4, "column time")]


def test_a_million_rows_are_read_in_seconds_and_more_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    rows = "".join(f"{k},1.5\n" for k in range(1_000_000))
    path.write_text("time [ms], wave [mm]\n" + rows, encoding="utf-8")
    begin = clock.process_time()
    assert len(read_time_history(path, "wave").time) == 1_000_000
    assert clock.process_time() - begin < 10.0
    path.write_text("time [ms], wave [mm]\n" + rows + "1000000,1\n", encoding="utf-8")
    with pytest.raises(InputError, match="are more than 1000000"):
        read_time_history(path, "wave")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (((0.0, 1.0), (1.0, "2")), None),
        (((0.0, 1.0), (1.0, None)), r"t\.xlsx:3: .*1 cells"),
        (((0.0, 1.0), (1.0, True)), r"t\.xlsx:3: column wave: True; is a bool"),
        (((0.0, 1.0), (1.0, "=1/0")), r"t\.xlsx:3: "),
        (((0.0, 1.0), (1.0, "#N/A")), r"t\.xlsx:3: column wave: #N/A; must start with a number"),
    ],
)
def test_cells_of_a_sheet_are_numbers_and_nothing_else(tmp_path: Path, rows, said: str | None) -> None:
    xlsx(tmp_path / "t.xlsx", rows=rows)
    if said is None:
        assert read_time_history(tmp_path / "t.xlsx", "wave").value[1] == 2e-3
        return
    with pytest.raises(InputError, match=said):
        read_time_history(tmp_path / "t.xlsx", "wave")


def test_of_several_sheets_none_is_guessed(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    book.create_sheet("other")
    book.save(tmp_path / "t.xlsx")
    with pytest.raises(InputError, match="has 2 sheets, must have one"):
        read_time_history(tmp_path / "t.xlsx", "wave")


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"wave": np.ones((4, 4))}, "shape 4x4; must be one column"),
        ({"wave": WAVE * 1j}, "must hold real numbers"),
        ({"wave": np.array(["a", "b"], dtype=object)}, "must hold real numbers"),
        ({"wave": WAVE > 0.0}, "must hold real numbers"),
        ({"wave": {"a": 1.0}}, "must hold real numbers"),
        ({"wave": np.ones(5)}, "must be as many as the 4 of time"),
        ({"wave_unit": ""}, "has no unit. Cure: store wave_unit = 'mm' beside it"),
        ({"wave": np.array([1.0, np.nan, 2.0, 3.0])}, "nan; must be finite"),
    ],
    ids=["matrix", "complex", "object", "logical", "struct", "length", "unit", "nan"],
)
def test_mat_variables_are_columns_of_real_numbers(tmp_path: Path, more, said: str) -> None:
    mat5(tmp_path / "t.mat", **more)
    with pytest.raises(InputError, match=said):
        read_time_history(tmp_path / "t.mat", "wave")


def test_a_mat_file_of_another_version_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "t.mat", {"time": TIME, "wave": WAVE}, format="4")
    with pytest.raises(InputError, match=r"no MAT-file of version 5 or 7\.3"):
        read_time_history(tmp_path / "t.mat", "wave")


def test_packed_netcdf_is_unpacked_and_missing_values_are_refused(tmp_path: Path) -> None:
    nc4(tmp_path / "t.nc", values=np.array([480, 0, 1, 2], dtype=np.int16), scale_factor=1e-4, add_offset=1.0)
    np.testing.assert_allclose(
        read_time_history(tmp_path / "t.nc", "wave").value, 1e-3 * (1.0 + 1e-4 * np.array([480, 0, 1, 2]))
    )
    nc4(tmp_path / "m.nc", values=np.array([480, -999, 1, 2], dtype=np.int16), _FillValue=np.int16(-999))
    with pytest.raises(InputError, match="1 samples, the first is number 2; are missing"):
        read_time_history(tmp_path / "m.nc", "wave")
    nc4(tmp_path / "u.nc", units="K")
    with pytest.raises(InputError, match="is no length or force"):
        read_time_history(tmp_path / "u.nc", "wave")


def test_hdf5_that_leads_elsewhere_or_was_never_written_is_refused(tmp_path: Path) -> None:
    nc4(tmp_path / "other.nc")

    def write(name: str, make) -> Path:
        nc4(tmp_path / name)
        with h5py.File(tmp_path / name, "a") as file:
            del file["wave"]
            make(file)
            if isinstance(file.get("wave", getlink=True), h5py.HardLink):
                file["wave"].attrs["units"] = "mm"
        return tmp_path / name

    def external(file):
        file["wave"] = h5py.ExternalLink("other.nc", "/wave")

    def stored(file):
        (tmp_path / "raw.bin").write_bytes(WAVE.tobytes())
        file.create_dataset("wave", shape=(4,), dtype="f8", external=[(str(tmp_path / "raw.bin"), 0, 32)])

    def empty(file):
        file.create_dataset("wave", shape=(4,), dtype="f8")

    def half(file):
        file.create_dataset("wave", shape=(4,), dtype="f8", chunks=(2,))[:2] = 1.0

    def bomb(file):
        file.create_dataset("wave", shape=(2_000_000_000,), dtype="f8", chunks=(1024,))

    def words(file):
        file["wave"] = ["a", "b", "c", "d"]

    def group(file):
        file.create_group("wave")

    for name, make, said in (
        ("a.nc", external, "is a link"),
        ("b.nc", stored, "is stored in another file"),
        ("c.nc", empty, "were never written"),
        ("d.nc", half, "1 of 2 parts that were never written"),
        ("e.nc", bomb, "are more than 1000000"),
        ("f.nc", words, "must hold real numbers"),
        ("g.nc", group, "must hold real numbers"),
    ):
        with pytest.raises(InputError, match=said):
            read_time_history(write(name, make), "wave")


@pytest.mark.parametrize("name", ["t.txt", "t.pkl", "t", "t.npy"])
def test_other_formats_are_refused_by_name(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(InputError, match=r"must end in \.csv, \.mat, \.nc, \.xlsx"):
        read_time_history(tmp_path / name, "wave")


@pytest.mark.parametrize("suffix", [".csv", ".xlsx", ".mat", ".nc"])
def test_a_file_that_is_not_there_or_of_another_kind_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"t{suffix}"
    with pytest.raises(InputError, match="does not exist"):
        read_time_history(path, "wave")
    path.mkdir()
    with pytest.raises(InputError, match="is a directory"):
        read_time_history(path, "wave")
    path.rmdir()
    path.write_bytes(b"\xff\xfe\x00nothing of the kind")
    with pytest.raises(InputError):
        read_time_history(path, "wave")


def test_one_row_is_counted_in_the_singular(tmp_path):
    path = tmp_path / "one.csv"
    path.write_text("time [s], wave [mm]\n0, 1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"has 1 data row\."):
        read_time_history(path, "wave")
