"""What an import has to tell."""

from __future__ import annotations


class Notices:
    """Lines of a file and what is to be said of them; the same is said once."""

    def __init__(self) -> None:
        self._lines: dict[tuple[int, str], None] = {}

    def add(self, line: int, words: str) -> None:
        """Take a notice."""
        plain = "".join(letter if letter.isprintable() else " " for letter in words)
        self._lines[line, plain] = None

    def in_order(self) -> list[tuple[int, str]]:
        """All notices by line number."""
        return sorted(self._lines, key=lambda notice: notice[0])
