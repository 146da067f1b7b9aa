"""The flight of docs/flight.md, written and run as the page stands."""

import json
import re
from pathlib import Path

from pages import commands, page, run, write_files

PAGE = page("flight.md")


def test_the_page_shows_what_its_commands_say(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_files(PAGE)
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, flags=re.M | re.S)
    said = []
    for command in commands(PAGE):
        status = run(command)
        assert status == (1 if "--linear" in command else 0), command
        said.append(capsys.readouterr().out)
    review, told, growth = said
    shown = [block for language, block in blocks if not language]
    assert len(shown) == 2
    for line in shown[0].splitlines():
        assert line in review
    assert shown[1] in growth
    keys = set(json.loads(told))
    named = PAGE[PAGE.index("- `--json`") : PAGE.index("SI, null where")]
    assert keys - {"name", "files"} <= set(re.findall(r"`(\w+)`", named))
    assert float(growth.split("they differ by ")[1].split(" %")[0]) < 0.15  # the page: 0.1 %
    assert Path("kick.html").stat().st_size > 100_000
    assert Path("need-LOX.csv").read_text().startswith("# damping required of LOX")
    assert Path("growth.png").stat().st_size > 10_000
