"""A campaign on disk: one immutable file for each block of cases, a header, a lock, and nothing that counts.

A block file is written under another name, flushed to the disk and then renamed; what is done is found out by reading
the blocks, each checked to its last byte. Two drivers on one store write the same bytes.
"""

import contextlib
import hashlib
import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sloshpy.dispersion import disk
from sloshpy.dispersion.block import decoded, encoded
from sloshpy.dispersion.lock import alive, locked
from sloshpy.dispersion.rows import Rows
from sloshpy.errors import InputError, Problem

HEADER = "campaign.json"
_SEALS = ("campaign", "sha256")
_TEMPORARY = re.compile(r"(?:block-\d{8}\.bin|campaign\.json)\.(\d+)\.tmp")


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a campaign's cases lie in blocks: N cases, so many in each block, the columns of each."""

    cases: int
    block: int
    columns: tuple[str, ...]

    @property
    def numbers(self) -> range:
        """The numbers of the blocks."""
        return range(-(-self.cases // self.block))

    def span(self, number: int) -> tuple[int, int]:
        """Return the first case of a block and how many it has."""
        first = number * self.block
        return first, min(self.block, self.cases - first)


@dataclass(frozen=True, kw_only=True)
class Store:
    """A folder that holds one campaign. header: what the campaign is and where it was made, as JSON."""

    folder: Path
    header: dict[str, Any]
    layout: Layout

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Hold the store for this process, let it grow to its number of cases, and sweep what a killed one left."""
        with locked(self.folder):
            if read_header(self.folder) != self.header:
                _write_header(self.folder, self.header)
            for path in sorted(self.folder.iterdir()):
                left = _TEMPORARY.fullmatch(path.name)
                if left is not None and not alive(int(left.group(1))):
                    disk.remove(path)
            yield

    def path(self, number: int) -> Path:
        """Return the file of a block."""
        return self.folder / f"block-{number:08d}.bin"

    def write(self, number: int, rows: Rows) -> None:
        """Write a block so that it is there whole or not at all, power failure included.

        Raises:
            InputError: the disk is full or does not take it; what was written before stays.
        """
        _write_whole(self.path(number), encoded(number, rows, self.header["campaign"]))

    def read(self, number: int) -> Rows | None:
        """Return the rows of a block, None where it is missing or any bit of it is not as written."""
        try:
            data = self.path(number).read_bytes()
        except FileNotFoundError:
            return None
        first, count = self.layout.span(number)
        rows = decoded(data, number, self.header["campaign"])
        return rows if rows is not None and rows.sound(first, count, len(self.layout.columns)) else None

    def lacking(self, case: int) -> str:
        """Return why there is no row of a case, in words; "" where there is one."""
        if case >= self.layout.cases:
            return f"the store ends with case {self.layout.cases - 1}"
        number = case // self.layout.block
        first, count = self.layout.span(number)
        if self.read(number) is not None:
            return ""
        what = "damaged" if self.path(number).exists() else "not there yet"
        return f"{self.path(number).name}, cases {first} to {first + count - 1}, is {what}"

    def done(self) -> list[int]:
        """Return the numbers of the blocks that are there, by reading each."""
        return [number for number in self.layout.numbers if self.read(number) is not None]


def open_store(folder: str | os.PathLike[str], header: dict[str, Any], layout: Layout, resume: bool) -> Store:
    """Make a store for a campaign, or take up the one that is there.

    Raises:
        InputError: the folder holds something else, another campaign (each difference is named), one of more cases, or
            one that was not to be resumed.
    """
    path = Path(folder)
    store = Store(folder=path, header=header, layout=layout)
    if (path / HEADER).exists():
        found = read_header(path)
        different = differences(found, header)
        if different:
            raise InputError(*(_refused(path, f"holds another campaign: {text}", cure) for text, cure in different))
        if layout.cases < found["cases"]:
            rule = f"holds a campaign of {found['cases']} cases, more than {layout.cases}"
            raise InputError(_refused(path, rule, "leave --cases out, or name a new folder"))
        if not resume:
            cure = "say --resume to compute what is missing, --partial to read what is there, or name another folder"
            raise InputError(_refused(path, "holds this campaign already", cure))
        return store
    try:
        disk.make_folder(path)
        others = [x.name for x in path.iterdir() if not _TEMPORARY.fullmatch(x.name) and x.name != "lock"]
    except OSError as error:
        raise InputError(
            _refused(path, f"cannot be made ({error.strerror})", "check the folder it stands in")
        ) from None
    if others:
        rule = f"is no store and not empty: {', '.join(sorted(others)[:3])}"
        raise InputError(_refused(path, rule, "name a new folder"))
    _write_header(path, header)
    return store


def _write_header(path: Path, header: dict[str, Any]) -> None:
    _write_whole(path / HEADER, (json.dumps(header, indent=1, sort_keys=True) + "\n").encode())


def read_header(folder: Path) -> dict[str, Any]:
    """Return what a store says it is.

    Raises:
        InputError: it is no store, or its header was changed.
    """
    header: dict[str, Any] = {}
    try:
        header = json.loads((folder / HEADER).read_text(encoding="utf-8"))
        whole = isinstance(header, dict) and header == sealed(header)
    except (OSError, ValueError):
        whole = False
    if not whole:
        raise InputError(_refused(folder, f"is no store: its {HEADER} is missing or changed", "name another folder"))
    return header


def sealed(header: dict[str, Any]) -> dict[str, Any]:
    """Return a header with its identity, which every block carries, and a hash of all of it."""
    rest = {key: value for key, value in header.items() if key not in _SEALS}
    rest["campaign"] = identity(rest)
    return rest | {"sha256": _hashed(rest)}


def identity(header: dict[str, Any]) -> str:
    """Return the hash of what makes a campaign this one; not of how many cases it has, which may grow."""
    return _hashed({key: value for key, value in header.items() if key not in {*_SEALS, "cases"}})


def _hashed(part: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(part, sort_keys=True).encode()).hexdigest()


def differences(found: dict[str, Any], wanted: dict[str, Any]) -> list[tuple[str, str]]:
    """Return each entry of two headers that differs, with what to do about it."""
    texts = []
    for key in sorted({*found, *wanted} - {*_SEALS, "cases"}):
        here, there = found.get(key), wanted.get(key)
        if here != there:
            cure = "run it with what the store was made with, or name a new folder"
            if isinstance(here, dict) and isinstance(there, dict):
                inner = sorted(k for k in {*here, *there} if here.get(k) != there.get(k))
                texts += [(f"{key} {k}: {here.get(k)} there, {there.get(k)} now", cure) for k in inner]
            else:
                texts.append((f"{key}: {here} there, {there} now", cure))
    return texts


def _write_whole(path: Path, data: bytes) -> None:
    temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        handle = disk.create(temporary)
        try:
            disk.write(handle, data)
            disk.sync(handle)
        finally:
            disk.close(handle)
        disk.rename(temporary, path)
        disk.sync_folder(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            disk.remove(temporary)
        rule = f"cannot take {path.name}, {len(data)} bytes ({error.strerror})"
        raise InputError(_refused(path.parent, rule, "make room; what is there stays, and --resume goes on")) from None


def _refused(folder: Path, rule: str, cure: str) -> Problem:
    return Problem(key="store", value=str(folder), rule=rule, cure=cure)
