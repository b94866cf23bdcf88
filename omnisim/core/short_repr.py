"""Representations of objects on one short line, whatever they hold."""

from __future__ import annotations

MAX_LENGTH = 190


def short_repr(shown: object, *parts: str) -> str:
    """Class of an object and its parts, empty ones left out, cut where they are too long."""
    text = ", ".join(" ".join(part.split()) for part in parts if part)
    room = MAX_LENGTH - len(type(shown).__name__)
    text = text if len(text) <= room else text[: room - 1] + "…"
    return f"{type(shown).__name__}({text})"


def counted(count: int, singular: str, plural: str = "") -> str:
    """Count with its noun; empty for none."""
    if count == 0:
        return ""
    return f"{count:,} {singular if count == 1 else plural or singular + 's'}"
