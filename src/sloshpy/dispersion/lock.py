"""One driver at a time in a store: a lock file with process, its start and the boot, so that a dead one is known."""

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path

from sloshpy.dispersion import disk
from sloshpy.errors import InputError, Problem

NAME = "lock"


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a store for this process.

    A lock left behind by a process that is gone, or from before a restart, is taken over. Should two take it over in
    the same instant, both write the same bytes.

    Raises:
        InputError: another process that lives holds it.
    """
    path, mine = folder / NAME, json.dumps(_identity(os.getpid()))
    try:
        handle = disk.create(path, fresh=True)
    except FileExistsError:
        holder = _holder(path)
        if holder is not None:
            rule = f"is being written by another run (process {holder})"
            cure = "wait for it, or stop it and say --resume"
            raise InputError(Problem(key="store", value=str(folder), rule=rule, cure=cure)) from None
        handle = disk.create(path)
    try:
        try:
            disk.write(handle, mine.encode())
        finally:
            disk.close(handle)
        yield
    finally:
        if _text(path) == mine:
            disk.remove(path)


def _holder(path: Path) -> int | None:
    """Return the process that holds a lock, None where it lives no more."""
    try:
        held = json.loads(_text(path))
        process = int(held["process"])
    except (ValueError, KeyError, TypeError):  # cut off while being written: its writer is gone, or was just now
        return None
    return process if held == _identity(process) else None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _identity(process: int) -> dict[str, object]:
    """Return what tells a process from a later one of the same number: its start and the boot."""
    boot, start = Path("/proc/sys/kernel/random/boot_id"), Path(f"/proc/{process}/stat")
    text = _text(start)
    if not boot.exists():  # no Linux: the number alone
        return {"process": process, "boot": "", "start": "alive" if alive(process) else ""}
    return {
        "process": process,
        "boot": _text(boot).strip(),
        "start": text.rpartition(")")[2].split()[19] if text else "",
    }


def alive(process: int) -> bool:
    """Return whether a process of this number runs."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True
