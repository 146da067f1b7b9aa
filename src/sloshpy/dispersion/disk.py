"""The few things the store does to a disk, one function each, so that a fault can be put before any of them."""

import os
from pathlib import Path


def make_folder(path: Path) -> None:
    """Make a folder; one that is there already is fine."""
    path.mkdir(parents=False, exist_ok=True)


def create(path: Path, fresh: bool = False) -> int:
    """Open a file for writing, empty; `fresh`: refuse one that is there."""
    return os.open(path, os.O_WRONLY | os.O_CREAT | (os.O_EXCL if fresh else os.O_TRUNC), 0o644)


def write(handle: int, data: bytes) -> None:
    """Write all the bytes: a system call may take a part of them."""
    rest = memoryview(data)
    while len(rest):
        rest = rest[os.write(handle, rest) :]


def sync(handle: int) -> None:
    """Wait until a file's bytes are on the disk."""
    os.fsync(handle)


def close(handle: int) -> None:
    """Close a file."""
    os.close(handle)


def rename(old: Path, new: Path) -> None:
    """Give a file its name, at once and in place of what had it."""
    os.replace(old, new)


def sync_folder(path: Path) -> None:
    """Wait until a folder's names are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def remove(path: Path) -> None:
    """Remove a file; one that is gone is fine."""
    path.unlink(missing_ok=True)
