"""The flight command: a shipped flight written beside the user and assessed; faults with exit status 2."""

import json
from pathlib import Path

import numpy as np
import pytest

from sloshpy.cli import main
from sloshpy.files import example_flight_names, read_flight, write_example


@pytest.fixture
def ascent(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_example("two_stage_ascent", tmp_path)


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    return int(ended.value.code)


def test_the_shipped_flight_has_a_hundred_times_and_says_that_it_is_reconstructed(ascent):
    assert example_flight_names() == ["two_stage_ascent"]
    assert "Reconstructed: no number is published" in ascent.read_text()
    flight = read_flight(ascent)
    assert flight.count >= 100
    assert len(flight.phases) == 3
    assert [phase.case.vehicle.mass.shape for phase in flight] == [phase.time.shape for phase in flight]
    mass = np.concatenate([phase.case.vehicle.mass for phase in flight])
    assert np.all(np.diff(mass) <= 0.0)


def test_an_example_is_not_written_over_what_is_there(ascent, capsys):
    ascent.unlink()
    assert run("example", "two_stage_ascent") == 2  # its folder is there still
    assert "is there already" in capsys.readouterr().err


def shortened(ascent: Path) -> None:
    """Leave the second stage alone, at four times, of which the first lies in the window of growth."""
    text = ascent.read_text()
    table, phase = text.index('[[table]]\nname = "second stage"'), text.index('[[phase]]\nname = "second stage"')
    head, middle = text[: text.index("[[table]]")], text[table : text.index("# Phases lie")]
    ascent.write_text(head + middle + text[phase:].replace('step = "5 s"', 'times = ["200 s", "400 s"]'))


def test_the_flight_command_prints_the_worst_with_its_time(ascent, capsys):
    shortened(ascent)
    status = run("flight", str(ascent), "--linear")
    said = capsys.readouterr().out
    assert status == 1  # no verdict
    assert said.startswith("NO VERDICT")
    assert "upper LOX slosh grows from 155.00" in said
    assert "4 times in 1 phases" in said


def test_faults_of_the_flight_end_with_status_2_and_their_rows(ascent, capsys):
    table = ascent.with_suffix("") / "second_stage.csv"
    lines = table.read_text().splitlines()
    lines[4] = lines[4].replace(",", ",9", 1)
    table.write_text("\n".join(lines))
    assert run("flight", str(ascent)) == 2
    told = capsys.readouterr().err
    assert "second_stage.csv:5: vehicle.mass" in told
    assert "Cure:" in told
    assert run("flight", str(ascent), "--every", "0") == 2
    capsys.readouterr()
    assert run("flight", str(ascent), "--linear", "--every", "2") == 2
    assert "--every: 2; is how often limit cycles are sought, and --linear leaves them out" in capsys.readouterr().err


def test_the_growth_of_a_mode_is_printed_with_its_simulation_and_drawn(ascent, capsys):
    shortened(ascent)
    words = ["--tank", "upper LOX", "--end", "180 s", "-o", "growth.png"]
    assert run("flight-growth", str(ascent), *words) == 0
    said = capsys.readouterr().out
    assert "upper LOX slosh from 0.01 m at 155 s" in said
    assert float(said.split("they differ by ")[1].split(" %")[0]) < 1.0
    assert Path("growth.png").stat().st_size > 10_000
    assert run("flight-growth", str(ascent), "--phase", "third stage") == 2
    assert "is no phase of the flight" in capsys.readouterr().err


def test_the_requirement_and_the_figures_are_written(ascent, capsys):
    shortened(ascent)
    assert run("flight", str(ascent), "--linear", "--requirement", "need.csv", "--figures", "figures") == 1
    assert Path("need-upper_LOX.csv").read_text().startswith("# damping required of upper LOX")
    assert len(list(Path("figures").iterdir())) == 6  # no limit cycles


def test_the_report_and_the_json_of_a_flight_are_written(ascent, capsys):
    shortened(ascent)
    assert run("flight", str(ascent), "--linear", "--json", "--report", "flight.html") == 1
    said = capsys.readouterr()
    told = json.loads(said.out)  # one object, nothing beside it
    assert told["verdict"] == "linear"
    assert told["phases"][0]["times"][0]["tanks"][0]["name"] == "upper LOX"
    assert "report: flight.html" in said.err
    assert "<svg" in Path("flight.html").read_text(encoding="utf-8")
    assert run("flight", str(ascent), "--report", "flight.txt") == 2
    assert run("flight", str(ascent), "--workers", "0") == 2
