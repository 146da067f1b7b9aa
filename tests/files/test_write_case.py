"""A case that is written reads back to an equal case."""

from pathlib import Path

import numpy as np
import pytest
from good_case import GOOD, POWER
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sloshpy.case import Case
from sloshpy.damping import TableDamping
from sloshpy.errors import InputError
from sloshpy.files import example_names, read_case, write_case, write_example

FULL = GOOD.replace('"900 kN"\n', '"202328 lbf"\nvectored_thrust = "0.8 MN"\ndrag = "1.1 kN"\n').replace(
    "attitude_gain = 0.08\n",
    'attitude_gain = 0.08\ngain = "-1.3 dB"\ndelay = "20 ms"\n'
    'actuator = { frequency = "6 Hz", damping = 0.7, deflection_limit = "6 deg", rate_limit = "15 deg/s" }\n',
)


def _values(node: object) -> object:
    """Return a case as plain values that compare, arrays as lists."""
    if isinstance(node, dict):
        return {key: _values(value) for key, value in node.items() if key != "source"}
    if isinstance(node, list | tuple):
        return [_values(value) for value in node]
    return node.tolist() if isinstance(node, np.ndarray) else node


def _same(one: Case, other: Case) -> bool:
    return _values(one.model_dump()) == _values(other.model_dump())


@pytest.mark.parametrize(
    "law",
    [
        POWER,
        '{ law = "power", slope = "0.3 1/m^0.5", exponent = 0.5 }',
        '{ law = "power", slope = "0.3 1/m^0.5", exponent = 0.5, largest_amplitude = "7.1 in" }',
        '{ law = "constant", ratio = "1.234567 %" }',
        '{ law = "table", amplitude = ["0 in", "3.3 in", "7 in"], ratio = [0.001, "0.7 %", 0.1] }',
        '{ law = "sum", of = [{ law = "constant", ratio = 0.01 }, '
        '{ law = "table", amplitude = ["0 m", "1 m"], ratio = [0, 0.1] }] }',
    ],
)
def test_a_written_case_reads_back_equal(tmp_path: Path, law: str) -> None:
    (tmp_path / "in.toml").write_text(FULL.replace(POWER, law))
    case = read_case(tmp_path / "in.toml")
    again = read_case(write_case(case, tmp_path / "out.toml"))
    assert _same(again, case)
    assert not _same(again, read_case(write_example("upper_stage", tmp_path)))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.toml", "out.toml", "upper_stage.toml"]


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mass=st.floats(1.6e4, 1e9), station=st.floats(0, 12), frequency=st.floats(1e-3, 1e3), gain_db=st.floats(-60, 60))
def test_every_digit_survives(tmp_path: Path, mass: float, station: float, frequency: float, gain_db: float) -> None:
    text = GOOD.replace('"16000 kg"', f'"{mass!r} kg"').replace('"9 m"', f'"{station!r} m"')
    text = text.replace('"2 rad/s"', f'"{frequency!r} Hz"').replace("0.08\n", f'0.08\ngain = "{gain_db:.12g} dB"\n')
    (tmp_path / "in.toml").write_text(text)
    case = read_case(tmp_path / "in.toml")
    assert _same(read_case(write_case(case, tmp_path / "out.toml", overwrite=True)), case)


def test_a_table_read_from_a_file_is_written_out(tmp_path: Path) -> None:
    (tmp_path / "d.csv").write_text("amplitude [in], ratio [%]\n0, 0.2\n10, 1.2\n")
    (tmp_path / "in.toml").write_text(GOOD.replace(POWER, '{ law = "table", file = "d.csv" }'))
    case = read_case(tmp_path / "in.toml")
    (tmp_path / "d.csv").unlink()
    again = read_case(write_case(case, tmp_path / "out.toml"))
    assert isinstance(again.vehicle.tanks[0].damping, TableDamping)
    assert _same(again, case)


def test_a_file_that_is_there_is_kept(tmp_path: Path) -> None:
    case = read_case(write_example("upper_stage", tmp_path))
    target = tmp_path / "kept.toml"
    target.write_text("mine")
    with pytest.raises(InputError, match="is there already"):
        write_case(case, target)
    assert target.read_text() == "mine"
    write_case(case, target, overwrite=True)
    assert read_case(target).name == case.name


def test_a_folder_that_is_missing_and_a_batch_are_refused(tmp_path: Path) -> None:
    case = read_case(write_example("upper_stage", tmp_path))
    with pytest.raises(InputError, match="cannot be written"):
        write_case(case, tmp_path / "no" / "case.toml")
    batch = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"mass": np.array([1.6e4, 1.7e4])})})
    with pytest.raises(InputError, match=r"mass: an array of shape \(2,\); has no place in a case file"):
        write_case(batch, tmp_path / "batch.toml")
    assert [p.name for p in tmp_path.iterdir()] == ["upper_stage.toml"]


def test_the_examples_are_copied_and_never_over_a_file(tmp_path: Path) -> None:
    assert {"upper_stage", "upper_stage_printed_alpha"} <= set(example_names())
    for name in example_names():
        path = write_example(name, tmp_path)
        assert path == tmp_path / f"{name}.toml"
        assert read_case(path).source.file == f"{name}.toml"
    path.write_text("mine")
    with pytest.raises(InputError, match="is there already"):
        write_example(name, tmp_path)
    assert path.read_text() == "mine"
    with pytest.raises(InputError, match=r"example: uper_stage; is none of .*upper_stage, upper_stage_printed_alpha"):
        write_example("uper_stage", tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        write_example("upper_stage", tmp_path / "no")
