"""What the readers of TOML files share: text to plain values, and faults in the order of the file."""

import re
import tomllib
from typing import Any

from sloshpy.errors import InputError, Problem
from sloshpy.files.places import Path, Place, Places
from sloshpy.files.wording import words_of

Found = list[tuple[Path, Problem]]


def parse_toml(text: str, file: str, places: Places) -> dict[str, Any]:
    """Return the text as plain values; a key that stands there twice is reported with both lines."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(
            Problem(
                key="TOML file",
                value="",
                rule="is nested too deeply",
                cure="six levels deep is the most that is read",
                file=file,
            )
        ) from None
    except ValueError as error:  # of TOML, or an integer of thousands of digits
        problems = [
            Problem(
                key=words_of(key, {}),
                value=" ".join(second.text.split())[:80],
                rule=f"is given twice, first in line {first.line}",
                cure="keep one of the two",
                file=file,
                line=second.line,
            )
            for key, first, second in places.twice
        ]
        found = re.search(r"\(at line (\d+), column (\d+)\)|\(at end of document\)", str(error))
        line = int(found.group(1)) if found and found.group(1) else text.rstrip("\n").count("\n") + 1
        if problems and (problems[0].line or 0) <= line:
            raise InputError(*problems) from None
        what = re.sub(r" *\(at .*\)$", "", str(error))
        shown = text.split("\n")[line - 1].strip()[:80]
        raise InputError(
            Problem(
                key="TOML syntax",
                value=shown,
                rule=what[:1].lower() + what[1:],
                cure='write key = value, with texts and quantities in quotation marks, as in mass = "16000 kg"',
                file=file,
                line=line,
            )
        ) from None


def once(found: Found) -> Found:
    """Return the faults, each once."""
    kept: Found = []
    for fault in found:
        if fault not in kept:
            kept.append(fault)
    return kept


def in_file_order(found: Found, file: str, places: Places) -> list[Problem]:
    """Return the problems with their places, first line first; a table's problems stand where the table is named."""
    nowhere = Place(line=1)
    placed = [((places.near(path) or nowhere).line, problem) for path, problem in found]
    placed.sort(key=lambda pair: pair[0])
    return [problem if problem.file else problem.at(file, line) for line, problem in placed]
