"""Where every key of a TOML text stands: its line and its value as written.

The values themselves come from the standard library's parser, which keeps no lines. tomlkit keeps the layout of a
table, not of a document: it gathers arrays of tables that are written apart, and tells no line of a repeated key.
"""

import re
import tomllib
from dataclasses import dataclass, field

Path = tuple[str | int, ...]

_SPACE = re.compile(r"(?:[ \t\n]|#[^\n]*)*")
_BLANK = re.compile(r"[ \t]*")
_KEY = re.compile(r'[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'')
_SCALAR = re.compile(
    r'"""(?:[^\\]|\\.)*?"""(?:"{0,2}(?!"))|\'\'\'.*?\'\'\'(?:\'{0,2}(?!\'))|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\''
    r"|\d{4}-\d\d-\d\d \d\d:[^\s,\]}#]+|[^\s,\[\]{}#\"']+",
    re.DOTALL,
)
_DEPTH = 50  # no case nests deeper than 6


@dataclass(frozen=True, kw_only=True)
class Place:
    """The line of a key or table header and the text of its value ("" for a table)."""

    line: int
    text: str = ""


@dataclass(kw_only=True)
class Places:
    """Every key of a text with its place, in file order, and the keys that stand there twice."""

    at: dict[Path, Place] = field(default_factory=dict)
    twice: list[tuple[Path, Place, Place]] = field(default_factory=list)
    whole: bool = False  # False: the text stopped being TOML somewhere

    def near(self, path: Path) -> Place | None:
        """Return the place of a key or, where it is not written, of the nearest thing around it."""
        for end in range(len(path), 0, -1):
            if path[:end] in self.at:
                return self.at[path[:end]]
        return None


def find_places(text: str) -> Places:
    """Return the place of every key of a TOML text; reading stops at the first thing that is not TOML."""
    scan = _Scan(text)
    try:
        scan.document()
        scan.places.whole = True
    except _NotTomlError:
        pass
    return scan.places


class _NotTomlError(Exception):
    """The text stopped being TOML; the parser has the words for it."""


class _Scan:
    """A reader of one text that walks it once and notes the keys."""

    def __init__(self, text: str) -> None:
        self.text, self.position = text, 0
        self.places = Places()
        self._counted, self._line = 0, 1
        self._lengths: dict[Path, int] = {}  # of arrays of tables
        self._tables: set[Path] = set()  # that have a [header] of their own

    def document(self) -> None:
        here: Path = ()
        while True:
            self._skip(_SPACE)
            if self.position == len(self.text):
                return
            if self.text.startswith("[", self.position):
                here = self._header()
            else:
                self._pair(here, depth=0)
            self._skip(_BLANK)
            if not self.text.startswith(("\n", "#"), self.position) and self.position < len(self.text):
                raise _NotTomlError

    def _header(self) -> Path:
        line, several = self._line_here(), self.text.startswith("[[", self.position)
        self.position += 1 + several
        keys = self._keys()
        self._take("]]" if several else "]")
        path: Path = ()
        for key in keys[:-1]:
            path = self._within((*path, key))
        path = (*path, keys[-1])
        place = Place(line=line)
        if several:
            self.places.at.setdefault(path, place)
            self._lengths[path] = self._lengths.get(path, 0) + 1
            path = (*path, self._lengths[path] - 1)
            self.places.at[path] = place
        else:
            if path in self._tables:
                self.places.twice.append((path, self.places.at[path], place))
            self._tables.add(path)
            self.places.at.setdefault(path, place)
        return path

    def _within(self, path: Path) -> Path:
        """Return the path of the latest table of an array of tables, or the path itself."""
        return (*path, self._lengths[path] - 1) if path in self._lengths else path

    def _pair(self, here: Path, depth: int) -> None:
        line = self._line_here()
        path = (*here, *self._keys())
        for end in range(len(here) + 1, len(path)):
            self.places.at.setdefault(path[:end], Place(line=line))  # tank.LOX = ... makes tank too
        self._take("=")
        self._skip(_BLANK)
        known = self.places.at.get(path)
        if known is None:
            self.places.at[path] = Place(line=line)  # keeps file order; its text follows
        start = self.position
        self._value(path, depth)
        place = Place(line=line, text=self.text[start : self.position])
        if known is None:
            self.places.at[path] = place
        else:
            self.places.twice.append((path, known, place))

    def _value(self, path: Path, depth: int) -> None:
        if depth > _DEPTH:
            raise _NotTomlError
        if self.text.startswith("[", self.position):
            self._list(path, depth)
        elif self.text.startswith("{", self.position):
            self._inline_table(path, depth)
        elif not self._skip(_SCALAR):
            raise _NotTomlError

    def _list(self, path: Path, depth: int) -> None:
        self._take("[")
        index = 0
        while not self._closed("]"):
            line, start = self._line_here(), self.position
            item = (*path, index)
            self.places.at.setdefault(item, Place(line=line))
            self._value(item, depth + 1)
            self.places.at[item] = Place(line=line, text=self.text[start : self.position])
            index += 1
            if not self._closed("]", stay=True):
                self._take(",")

    def _inline_table(self, path: Path, depth: int) -> None:
        self._take("{")
        while not self._closed("}"):
            self._pair(path, depth + 1)
            if not self._closed("}", stay=True):
                self._take(",")

    def _closed(self, bracket: str, stay: bool = False) -> bool:
        self._skip(_SPACE)
        if not self.text.startswith(bracket, self.position):
            return False
        self.position += 0 if stay else 1
        return True

    def _keys(self) -> list[str]:
        keys = []
        while True:
            self._skip(_BLANK)
            found = _KEY.match(self.text, self.position)
            if found is None:
                raise _NotTomlError
            self.position = found.end()
            keys.append(_plain(found.group()))
            self._skip(_BLANK)
            if not self.text.startswith(".", self.position):
                return keys
            self.position += 1

    def _take(self, sign: str) -> None:
        if not self.text.startswith(sign, self.position):
            raise _NotTomlError
        self.position += len(sign)

    def _skip(self, pattern: re.Pattern[str]) -> bool:
        found = pattern.match(self.text, self.position)
        if found is None:
            return False
        self.position = found.end()
        return True

    def _line_here(self) -> int:
        self._line += self.text.count("\n", self._counted, self.position)
        self._counted = self.position
        return self._line


def _plain(key: str) -> str:
    """Return a key without its quotation marks."""
    if key[0] not in "\"'":
        return key
    try:
        return str(tomllib.loads(f"key = {key}")["key"])
    except tomllib.TOMLDecodeError:
        raise _NotTomlError from None
