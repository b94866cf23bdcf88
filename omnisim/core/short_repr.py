"""Short one-line representations of objects."""

from __future__ import annotations

MAX_LENGTH = 190


def short_repr(instance: object, *parts: str) -> str:
    """Class name of an object and its non-empty parts, truncated if too long."""
    text = ", ".join(" ".join(part.split()) for part in parts if part)
    room = MAX_LENGTH - len(type(instance).__name__)
    text = text if len(text) <= room else text[: room - 1] + "…"
    return f"{type(instance).__name__}({text})"


def counted(count: int, singular: str, plural: str = "") -> str:
    """Count with its noun; empty for a count of 0."""
    if count == 0:
        return ""
    return f"{count:,} {singular if count == 1 else plural or singular + 's'}"
