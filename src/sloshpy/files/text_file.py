"""The text of one file: what a user may hand in, and what is said of everything else."""

import os
import stat
from pathlib import Path

from sloshpy.errors import InputError, Problem

LARGEST = 10_000_000  # bytes; the largest case file seen has 3000, a damping table 10 000


def read_text(path: str | os.PathLike[str], what: str, largest: int = LARGEST) -> tuple[bytes, str]:
    """Read a UTF-8 file and return its bytes and its text with plain line ends and no byte order mark.

    Args:
        path: the file.
        what: what the file should be, for messages: "case file".
        largest: bytes that it may have.

    Raises:
        InputError: no such file, no regular file, no permission, too large, empty or not UTF-8.
    """
    raw = read_bytes(path, what, largest)
    name = os.fspath(path)

    def refused(rule: str, cure: str, line: int | None = None) -> InputError:
        return InputError(
            Problem(key=what, value=name if line is None else "", rule=rule, cure=cure, file=name, line=line)
        )

    try:
        text = raw.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise refused(f"is not UTF-8 text at byte {error.start}", "save the file as UTF-8", line) from None
    if not text.strip():
        raise refused("is empty", "fill it in or name another file")
    return raw, text.replace("\r\n", "\n").replace("\r", "\n")


def read_bytes(path: str | os.PathLike[str], what: str, largest: int) -> bytes:
    """Read a file that a user named and return its bytes.

    Raises:
        InputError: no such file, no regular file, no permission or more than `largest` bytes.
    """
    name = os.fspath(path)

    def refused(rule: str, cure: str) -> InputError:
        return InputError(Problem(key=what, value=name, rule=rule, cure=cure, file=name))

    try:
        state = os.stat(name)
        if stat.S_ISDIR(state.st_mode):
            raise refused("is a directory", "name the file in it")
        if not stat.S_ISREG(state.st_mode):
            raise refused("is not a regular file", "name a file on disk")
        if state.st_size > largest:
            raise refused(f"has {state.st_size} bytes, more than {largest}", "check that this is the file you meant")
        with open(name, "rb") as stream:
            raw = stream.read(largest + 1)
    except InputError:
        raise
    except (FileNotFoundError, NotADirectoryError):
        raise refused("does not exist", "check its name and its folder") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise refused(f"cannot be read ({error})", "check the path and its permissions") from None
    if len(raw) > largest:
        raise refused(f"has more than {largest} bytes", "check that this is the file you meant")
    return raw


def beside(file: str, folder: Path) -> Path:
    """Return the path of a file named inside a case file, which must lie in the case file's folder.

    Raises:
        ValueError: with the rule that the name breaks; the caller knows the place.
    """
    if "://" in file:
        raise ValueError("is an address on a network")
    if not file.strip() or "\x00" in file or "\\" in file or ":" in file:
        raise ValueError("is not a plain relative path")
    if Path(file).is_absolute():
        raise ValueError("is an absolute path")
    if file.startswith("~") or ".." in Path(file).parts:
        raise ValueError("leads out of the case file's folder")
    path = folder / file
    try:
        if not path.resolve().is_relative_to(folder.resolve()):
            raise ValueError("is a link that leads out of the case file's folder")
    except (OSError, RuntimeError):
        raise ValueError("cannot be followed") from None
    return path
