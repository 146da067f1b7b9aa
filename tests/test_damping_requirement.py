"""The requirement handed to the baffle designer: the numbers of the verb, and the same in every format."""

import h5py
import numpy as np
import openpyxl
import pytest

from sloshpy.errors import InputError
from sloshpy.files import read_case, write_example, write_requirement
from sloshpy.flight import Phase, Trajectory, assess_flight, damping_requirement
from sloshpy.stability import required_damping
from sloshpy.stability.margins import margins


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    case = read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))
    tank = case.vehicle.tanks[0].model_copy(update={"station": np.array([9.0, 7.0, -9.0]), "radius": 2.5})
    moved = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": (tank,)})})
    phase = Phase(name="climb", time=np.array([0.0, 10.0, 20.0]), case=moved, fill=np.array([[0.9], [0.6], [0.3]]))
    return damping_requirement(assess_flight(Trajectory(name="flight", phases=(phase,)), cycles=0), "LOX"), phase


def test_each_row_is_the_requirement_of_its_case_and_meets_the_criterion(found):
    table, phase = found
    for k, case in enumerate(phase.cases):
        assert table.required[k] == pytest.approx(float(required_damping(case).required), rel=1e-7)
        if table.required[k] > 0.0:
            kept = margins(case, damping=table.required[k] * (1.0 + 1e-6))
            assert float(kept.slosh_disc_margin(0)[0]) == pytest.approx(1.0, abs=1e-4)
    assert table.available == pytest.approx(0.1 * 0.25)  # alpha A at a tenth of the radius
    assert table.required[0] == pytest.approx(0.047358, rel=1e-4)
    assert table.worst == int(np.argmax(table.required)) == 1
    assert "60 % full" in str(table)


def test_every_format_holds_the_table_its_criterion_and_its_assumptions(found, tmp_path):
    table, _ = found
    text = write_requirement(table, tmp_path / "need.csv").read_text()
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    at = rows[0].index("required_damping [1]")
    assert [float(row[at]) for row in rows[1:]] == pytest.approx(table.required)
    assert "# criterion: disc margin of eq 24 >= 1 at 6 dB and 30 deg" in text
    assert "up to 0.3" in text
    book = openpyxl.load_workbook(write_requirement(table, tmp_path / "need.xlsx"))
    sheet = [[cell.value for cell in row] for row in book["requirement"].iter_rows()]
    assert [row[at] for row in sheet[1:]] == pytest.approx(table.required)
    assert "criterion" in book["basis"]["A3"].value
    with h5py.File(write_requirement(table, tmp_path / "need.nc")) as store:
        assert store["required_damping"][()] == pytest.approx(table.required)
        assert "6 dB" in store.attrs["criterion"]
        assert "frozen" in store.attrs["assumptions"]
    with pytest.raises(InputError, match=r"must end in \.csv"):
        write_requirement(table, tmp_path / "need.txt")
    with pytest.raises(ValueError, match="no tank"):
        damping_requirement(assess_flight(Trajectory(name="x", phases=(found[1],)), 0), "LH2")
