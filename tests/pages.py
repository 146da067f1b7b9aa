"""The pages of `docs/` that are run as they stand: their files written, their commands given to the command line."""

import re
import shlex
from pathlib import Path

import pytest

from sloshpy.cli import main


def page(name):
    return (Path(__file__).parents[1] / "docs" / name).read_text(encoding="utf-8")


def write_files(text):
    """Write each file that a page names and shows into the current folder."""
    for name, content in re.findall(r"^`([\w.]+)`:\n\n```\w+\n(.*?)^```", text, flags=re.M | re.S):
        Path(name).write_text(content, encoding="utf-8")


def commands(text):
    return [line for block in re.findall(r"^```sh\n(.*?)^```", text, flags=re.M | re.S) for line in block.splitlines()]


def run(line):
    """Return the exit status of a command."""
    with pytest.raises(SystemExit) as end:
        main(shlex.split(line)[1:])
    return int(end.value.code or 0)
