"""Notices of a stage: one line with a count for each feature that is not drawn."""

from __future__ import annotations

from collections import Counter

from omnisim.core.short_repr import counted


class Notices:
    """Features that are not drawn, in order of occurrence."""

    def __init__(self) -> None:
        self._plain: dict[str, None] = {}
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, text: str) -> None:
        """Add a line without a count."""
        self._plain[text] = None

    def count(self, text: str, noun: str = "prim") -> None:
        """Count one use of a feature."""
        self._counts[text, noun] += 1

    @property
    def lines(self) -> list[str]:
        """Notices, one line per feature."""
        uses = [
            f"{text} ({counted(n, noun, 'meshes' if noun == 'mesh' else '')})"
            for (text, noun), n in self._counts.items()
        ]
        return [*self._plain, *uses]
