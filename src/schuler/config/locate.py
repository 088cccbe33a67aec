"""Where each key of a TOML text stands: a line for every path of keys.

`tomllib` gives values but not places. The text has been parsed by it before, so this scanner may
take for granted that the text is valid, and needs to know only where strings, tables and arrays
begin and end.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field

__all__ = ["Path", "line_of", "locate"]

Path = tuple[str | int, ...]

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^,\]}#\n]+")


@dataclass
class _Scanner:
    text: str
    at: int = 0
    lines: dict[Path, int] = field(default_factory=dict)
    counts: dict[Path, int] = field(default_factory=dict)

    def line(self) -> int:
        return self.text.count("\n", 0, self.at) + 1

    def skip(self, newlines: bool) -> None:
        """Pass over blanks and comments, and line ends where they mean nothing."""
        while self.at < len(self.text):
            c = self.text[self.at]
            if c == "#":
                end = self.text.find("\n", self.at)
                self.at = len(self.text) if end < 0 else end
            elif c in " \t\r" or (newlines and c == "\n"):
                self.at += 1
            else:
                return

    def string(self) -> str:
        """Take a string with its quotes."""
        start, quote = self.at, self.text[self.at]
        long = self.text.startswith(3 * quote, self.at)
        mark = 3 * quote if long else quote
        self.at += len(mark)
        while not self.text.startswith(mark, self.at):
            self.at += 2 if quote == '"' and self.text[self.at] == "\\" else 1
        self.at += len(mark)
        # Up to two more quotes may belong to the text of a long string.
        while long and self.at < len(self.text) and self.text[self.at] == quote:
            self.at += 1
        return self.text[start : self.at]

    def key(self) -> list[str]:
        """Take a key with its dots."""
        parts = []
        while True:
            self.skip(False)
            if self.text[self.at] in "\"'":
                parts.append(str(tomllib.loads(f"x = {self.string()}")["x"]))
            else:
                found = _BARE.match(self.text, self.at)
                assert found is not None
                parts.append(found[0])
                self.at = found.end()
            self.skip(False)
            if self.text[self.at] != ".":
                return parts
            self.at += 1

    def value(self, path: Path) -> None:
        """Take a value, noting what is inside."""
        c = self.text[self.at]
        if c in "\"'":
            self.string()
        elif c == "[":
            self.at += 1
            k = 0
            self.skip(True)
            while self.text[self.at] != "]":
                self.note((*path, k))
                self.value((*path, k))
                k += 1
                self.comma()
            self.at += 1
        elif c == "{":
            self.at += 1
            self.skip(True)
            while self.text[self.at] != "}":
                self.pair(path)
                self.comma()
            self.at += 1
        else:
            found = _SCALAR.match(self.text, self.at)
            assert found is not None
            self.at = found.end()

    def comma(self) -> None:
        self.skip(True)
        if self.text[self.at] == ",":
            self.at += 1
            self.skip(True)

    def pair(self, table: Path) -> None:
        line = self.line()
        key = self.key()
        for k in range(1, len(key) + 1):
            self.lines.setdefault((*table, *key[:k]), line)
        self.at += 1
        self.skip(False)
        self.value((*table, *key))

    def note(self, path: Path) -> None:
        self.lines.setdefault(path, self.line())

    def header(self) -> Path:
        """Take ``[a.b]`` or ``[[a.b]]``; return the path of the table."""
        line = self.line()
        several = self.text.startswith("[[", self.at)
        self.at += 2 if several else 1
        key = self.key()
        self.at += 2 if several else 1
        path: Path = ()
        for k, part in enumerate(key):
            path = (*path, part)
            last = k == len(key) - 1
            self.lines.setdefault(path, line)
            if several and last:
                self.counts[path] = self.counts.get(path, -1) + 1
            if path in self.counts:
                path = (*path, self.counts[path])
                self.lines.setdefault(path, line)
        return path

    def run(self) -> dict[Path, int]:
        """Return the line of each key."""
        table: Path = ()
        self.skip(True)
        while self.at < len(self.text):
            if self.text[self.at] == "[":
                table = self.header()
            else:
                self.pair(table)
            self.skip(True)
        return self.lines


def locate(text: str) -> dict[Path, int]:
    """Return the line (from 1) of every key, table and array element of a valid TOML text.

    Parameters
    ----------
    text : str
        The text, which `tomllib` has accepted.
    """
    return _Scanner(text.replace("\r\n", "\n")).run()


def line_of(lines: dict[Path, int], path: Path) -> int:
    """Return the line of a path, or of the nearest table around it; 1 for the whole."""
    for k in range(len(path), 0, -1):
        if path[:k] in lines:
            return lines[path[:k]]
    return 1
