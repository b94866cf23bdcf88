"""Syntax of USARBot.ini: sections of keys, and parenthesized values that may nest.

    [USARBot.P2AT]
    Sensors=(ItemClass=class'USARBot.SICKLMS',ItemName="Scanner1",Position=(X=0.1,Y=0,Z=-0.2))

A repeated key forms a list. Case is ignored. `;`, `#` and `//` start comments.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Union

from omnisim.core.errors import RobotFileError
from omnisim.core.trajectories.formats.text_table import quote

COMMENTS = (";", "#", "//")
MAX_DEPTH = 8
# The engine's lists may have an index, Sensors(3)=, and extend inherited lists, +Sensors=.
_ENTRY = re.compile(r"([-+.!]?[A-Za-z_]\w*)(?:[(\[]\d+[)\]])?\s*=\s*(.*)")
_SECTION = re.compile(r"\[([^\[\]]+)\]\s*(.*)")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0e-\x1f]")

Value = Union[str, "Struct"]
# Name in lower case, mapped to the name as written and its value.
Struct = dict[str, tuple[str, Value]]
Notice = tuple[int, str]  # line number and text


@dataclass(frozen=True)
class Entry:
    """Line of a section: key, value, file and line number."""

    key: str
    value: str
    source: Path
    line: int

    def fault(self, message: str) -> RobotFileError:
        """Error that names file and line."""
        return RobotFileError(f"{self.source}:{self.line}: {message}")


@dataclass(frozen=True)
class Section:
    """Section with all its lines; sections of the same name are merged."""

    name: str
    line: int
    entries: tuple[Entry, ...]

    def values_of(self, key: str) -> list[Entry]:
        """Entries with a key, regardless of case."""
        return [entry for entry in self.entries if entry.key.lower() == key.lower()]


def read_ini(path: Path) -> dict[str, Section]:
    """Read the sections of a file, keyed by lower-case name.

    Raises:
        RobotFileError: invalid syntax or value; names file, line, actual and expected text.
    """
    sections: dict[str, tuple[str, int, list[Entry]]] = {}
    entries: list[Entry] | None = None
    for number, line in enumerate(_text(path).split("\n"), start=1):
        content = line.strip()
        if not content or content.startswith(COMMENTS):
            continue
        heading, entry = _SECTION.fullmatch(content), _ENTRY.fullmatch(content)
        if heading and (not heading[2] or heading[2].startswith(COMMENTS)):
            name = heading[1].strip()
            entries = sections.setdefault(name.lower(), (name, number, []))[2]
        elif entry and entries is not None:
            entries.append(Entry(entry[1].lstrip("+."), entry[2], path, number))
        else:
            expected = "[section]" if entries is None else "[section] or key=value"
            raise RobotFileError(f"{path}:{number}: {quote(content)!r}: expected {expected}")
    if not sections:
        raise RobotFileError(f"{path}:1: nothing in it: expected a USARBot.ini with [sections]")
    return {
        key: Section(name, line, tuple(entries)) for key, (name, line, entries) in sections.items()
    }


def parse_struct(entry: Entry) -> Struct:
    """Parse the parenthesized value of an entry.

    Raises:
        RobotFileError: invalid syntax or value; names file, line, actual and expected text.
    """
    return _Reader(entry).whole()


def printable(text: str) -> str:
    """Replace unprintable characters with spaces."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise RobotFileError(f"{path}: cannot be read: {reason.strerror}") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", errors="replace")  # Windows' encoding in USARSim's time
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    odd = _CONTROL.search(text)
    if odd:
        number = text.count("\n", 0, odd.start()) + 1
        raise RobotFileError(f"{path}:{number}: not a text file: expected a USARBot.ini")
    return text


class _Reader:
    """Parser of a single value, from left to right."""

    def __init__(self, entry: Entry) -> None:
        self._entry, self._text, self._at = entry, entry.value, 0

    def _fault(self, message: str) -> RobotFileError:
        return self._entry.fault(f"{self._entry.key}: {message}")

    def whole(self) -> Struct:
        if self._next() != "(":
            raise self._entry.fault(f"{self._entry.key}={quote(self._text)}: expected (...)")
        struct = self._struct(1)
        rest = self._text[self._at :].strip()
        if rest and not rest.startswith(COMMENTS):
            raise self._fault(f"{quote(rest)!r} after the last parenthesis: unbalanced parentheses")
        return struct

    def _next(self) -> str:
        """Skip whitespace and return the next character, or "" at the end."""
        while self._at < len(self._text) and self._text[self._at].isspace():
            self._at += 1
        return self._text[self._at : self._at + 1]

    def _struct(self, depth: int) -> Struct:
        if depth > MAX_DEPTH:
            raise self._fault(f"more than {MAX_DEPTH} parentheses deep")
        self._at += 1
        struct: Struct = {}
        while True:
            if self._next() == ",":
                self._at += 1
            elif self._next() == ")":
                self._at += 1
                return struct
            elif not self._next():
                raise self._fault("a parenthesis is not closed")
            else:
                name, value = self._pair(depth)
                if name.lower() in struct:
                    raise self._fault(f"{name} twice: expected it once")
                struct[name.lower()] = (name, value)

    def _pair(self, depth: int) -> tuple[str, Value]:
        match = re.compile(r"([A-Za-z_][\w()\[\]]*)\s*=").match(self._text, self._at)
        if match is None:
            rest = quote(self._text[self._at :])
            raise self._fault(f"{rest!r}: expected name=value")
        self._at = match.end()
        if self._next() == "(":
            return match[1], self._struct(depth + 1)
        return match[1], "".join(self._pieces(match[1])).strip()

    def _pieces(self, name: str) -> Iterator[str]:
        """Yield the pieces of a plain value; quoted pieces may contain commas and parentheses."""
        while self._at < len(self._text) and self._text[self._at] not in ",()":
            letter = self._text[self._at]
            end = self._at + 1
            if letter in "\"'":
                end = self._text.find(letter, self._at + 1) + 1
                if not end:
                    raise self._fault(f"{name}: a quote is not closed")
            yield self._text[self._at : end]
            self._at = end
        if self._text[self._at : self._at + 1] == "(":
            raise self._fault(f"{name}: a parenthesis within a word")
