"""Notices of an import."""

from __future__ import annotations


class Notices:
    """Notices about lines of a file, each once."""

    def __init__(self) -> None:
        self._lines: dict[tuple[int, str], None] = {}

    def add(self, line: int, words: str) -> None:
        """Add a notice."""
        plain = "".join(letter if letter.isprintable() else " " for letter in words)
        self._lines[line, plain] = None

    def in_order(self) -> list[tuple[int, str]]:
        """All notices by line number."""
        return sorted(self._lines, key=lambda notice: notice[0])
