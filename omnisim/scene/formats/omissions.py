"""Unsupported or approximated parts of a file, as notices."""

from __future__ import annotations

from collections import Counter

from omnisim.core.short_repr import counted


class Omissions:
    """Omitted or approximated parts, in order of occurrence."""

    def __init__(self) -> None:
        self._plain: dict[str, None] = {}
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, text: str) -> None:
        """Add a line without a count."""
        self._plain[text] = None

    def count(self, effect: str, noun: str = "prim") -> None:
        """Count one more part.

        Args:
            effect: text of the notice.
            noun: singular noun for the counted parts.
        """
        self._counts[effect, noun] += 1

    @property
    def notices(self) -> list[str]:
        """Notices, one line per effect."""
        uses = [
            f"{text} ({counted(n, noun, 'meshes' if noun == 'mesh' else '')})"
            for (text, noun), n in self._counts.items()
        ]
        return [*self._plain, *uses]
