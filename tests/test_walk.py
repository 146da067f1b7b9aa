"""The walk of docs/tank-to-verdict.md, from a contour and a record to a verdict, run as it stands."""

import re
from pathlib import Path

import pytest

from pages import commands, page, run, write_files
from sloshpy.files import read_case

PAGE = page("tank-to-verdict.md")
HERE = "# damping: the line goes here"


def test_the_page_leads_from_contour_and_record_to_the_verdict_it_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_files(PAGE)
    said = {}
    for command in commands(PAGE):
        if command.startswith("sloshpy assess"):
            (damping,) = re.findall(r"^damping = .*$", said["decay"], flags=re.M)
            assert HERE in Path("stage.toml").read_text()
            Path("stage.toml").write_text(Path("stage.toml").read_text().replace(HERE, damping))
        assert run(command) == 0, command
        said[command.split()[1]] = capsys.readouterr().out
    shown = re.findall(r"^```\n(PASS.*?)^```", PAGE, flags=re.M | re.S)[0]
    assert said["assess"].startswith(shown)
    assert Path("stage.html").stat().st_size > 50_000
    assert Path("lox-tank.png").exists()
    tank = read_case("stage.toml").vehicle.tanks[0]
    # the page's words: 6625 kg at 0.589 Hz, 6.72 m forward; the law of the record's truth, 0.5 1/m at 0.5 m radius
    assert float(tank.slosh_mass) == pytest.approx(6625.0, abs=1.0)
    assert float(tank.station) == pytest.approx(6.72, abs=0.005)
    assert float(tank.damping.ratio(0.2)) == pytest.approx(0.5 * 0.5 / 1.6 * 0.2, rel=0.01)


def test_a_test_that_ended_too_early_supports_no_number(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, text in re.findall(r"^`([\w.]+)`:\n\n```\w+\n(.*?)^```", PAGE, flags=re.M | re.S):
        Path(name).write_text(text, encoding="utf-8")
    short = 'damping = { law = "table", amplitude = ["0.03 m", "0.05 m", "0.07 m"], ratio = [0.0047, 0.0078, 0.0109] }'
    Path("stage.toml").write_text(Path("stage.toml").read_text().replace(HERE, short))
    assert run("sloshpy assess stage.toml") == 1
    assert "end with 1.09 % at 0.07 m" in capsys.readouterr().out
