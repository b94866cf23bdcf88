"""Counts of unsupported parts of a file."""

from __future__ import annotations

from omnisim.core.short_repr import counted


class Omissions:
    """Counts of omitted or approximated parts, for notices."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str], int] = {}

    def add(self, effect: str, noun: str) -> None:
        """Count one more part.

        Args:
            effect: text of the notice.
            noun: singular noun for the counted parts.
        """
        key = effect, noun
        self._counts[key] = self._counts.get(key, 0) + 1

    @property
    def notices(self) -> list[str]:
        """Notices, one line per effect."""
        return [
            f"{effect} ({counted(count, noun)})" for (effect, noun), count in self._counts.items()
        ]
