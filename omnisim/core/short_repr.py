"""Short texts: one-line representations of objects, counts and numbers."""

from __future__ import annotations

from collections.abc import Iterable

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


def number_text(value: float, digits: int = 6, decimals: int = 6) -> str:
    """Number with some significant digits: rounding errors are 0, and so is −0.

    It is first rounded to `decimals`; a millionth of its unit must not matter.
    """
    return f"{round(float(value), decimals):z.{digits}g}"


def point_text(values: Iterable[float], digits: int = 6, decimals: int = 6) -> str:
    """Coordinates in parentheses, each as by `number_text`."""
    return f"({', '.join(number_text(value, digits, decimals) for value in values)})"
