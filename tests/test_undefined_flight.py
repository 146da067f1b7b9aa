"""Where a flight has no number its text, report and JSON say so in words, and the command ends with status 1."""

import json

import numpy as np
import pytest

from report.test_report import Page
from sloshpy.cli import main
from sloshpy.damping import TableDamping
from sloshpy.files import read_case, write_example
from sloshpy.flight import Phase, Trajectory, assess_flight
from sloshpy.flight.worst import worst_of
from sloshpy.report import flight_report_html


@pytest.fixture(scope="module")
def unknown(tmp_path_factory):
    """Return a flight whose damping data end before what is needed, on a loop that no damping saves at its end."""
    case = read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))
    law = TableDamping(amplitude=np.array([0.0, 0.02]), ratio=np.array([0.001, 0.002]))
    tank = case.vehicle.tanks[0].model_copy(update={"damping": law})
    pilot = case.autopilot.model_copy(update={"delay": np.array([0.0, 2.5])})
    short = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": (tank,)}), "autopilot": pilot})
    return assess_flight(Trajectory(name="x", phases=(Phase(name="x", time=np.array([0.0, 9.0]), case=short),)))


def test_what_is_undefined_is_told_in_words(unknown):
    required = unknown.reviews[0].required_damping[:, 0]
    assert np.isfinite(required[0])
    assert np.isnan(required[1])
    assert np.isnan(unknown.reviews[0].cycle_tvc[0, 0])
    assert unknown.verdict in {"fail", "invalid"}
    said = str(unknown)
    assert "none suffices" in said
    assert "no number at" in said
    words = Page(flight_report_html(unknown)).words
    for text in (said, words):
        assert not {"nan", "inf", "-inf"} & set(text.replace(",", " ").split())
    told = json.loads(unknown.to_json(), parse_constant=lambda text: pytest.fail(text))
    assert told["phases"][0]["times"][1]["tanks"][0]["required_damping"] is None


def test_the_worst_is_where_there_is_no_number(unknown):
    worst = {one.criterion: one for one in worst_of(unknown.reviews)}
    assert worst["LOX: required damping"].time == 9.0
    assert worst["LOX: limit cycle, engine"].met is None


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    return int(ended.value.code)


def test_a_simulation_that_leaves_the_data_ends_with_status_1(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = write_example("upper_stage", tmp_path)
    text = path.read_text()
    start, end = text.index("[tank.damping]"), text.index("[autopilot]")
    law = '[tank.damping]\nlaw = "table"\namplitude = ["0 m", "0.06 m"]\nratio = [0.0, 0.001]\n\n'
    path.write_text(text[:start] + law + text[end:])
    assert run("simulate", str(path)) == 1
    assert "beyond the damping data" in capsys.readouterr().out


@pytest.mark.parametrize(("limit", "status"), [("0.1 deg", 1), ("0.5 deg", 0)])
def test_a_flight_ends_with_1_where_it_fails_and_0_where_it_passes(tmp_path, monkeypatch, capsys, limit, status):
    """The paper's stage cycles with 0.28 deg."""
    monkeypatch.chdir(tmp_path)
    path = write_example("upper_stage", tmp_path)
    path.write_text(path.read_text().replace('tvc_amplitude = "0.5 deg"', f'tvc_amplitude = "{limit}"'))
    (tmp_path / "flight.toml").write_text(
        f'name = "x"\n[[table]]\nname = "t"\nfile = "t.csv"\ninterpolation = "linear"\ntime = "t"\n'
        f'[table.columns]\n"autopilot.delay" = "d"\n[[phase]]\nname = "p"\ncase = "{path.name}"\n'
        'start = "0 s"\nend = "1 s"\nstep = "1 s"\ntables = ["t"]\n'
    )
    (tmp_path / "t.csv").write_text("t [s],d [ms]\n0,1\n1,1\n")
    assert run("flight", "flight.toml") == status
    assert capsys.readouterr().out.startswith("FAIL" if status else "PASS")
