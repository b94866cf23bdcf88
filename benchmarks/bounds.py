"""Bounds and goals of measured numbers.

A bound is where a number has become worse for certain, whatever the machine: it decides the exit
status. A goal is where a number should be; reports have the distance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from benchmarks.timer import MedianInterval

Sense = Literal["at least", "at most"]


@dataclass(frozen=True)
class Limits:
    """Bound and goal of a measured number.

    Attributes:
        bound: worst value that is no regression; None: goal only.
        goal: desired value; None: bound only.
        at_least: both are minima rather than maxima.
        software_only: the bound holds for software OpenGL only: no GPU has been measured.
        reason: derivation of the bound.
    """

    bound: float | None = None
    goal: float | None = None
    at_least: bool = False
    software_only: bool = False
    reason: str = ""

    def judge(
        self, name: str, value: float | MedianInterval, is_software: bool = True
    ) -> dict[str, Any]:
        """Entry of a report's `bounds`.

        Args:
            name: name of the number.
            value: number, or a median with its interval.
            is_software: OpenGL is a software renderer.
        """
        interval = value if isinstance(value, MedianInterval) else None
        entry: dict[str, Any] = {
            "name": name,
            "value": value if interval is None else interval.median,
            "low": None if interval is None else interval.low,
            "high": None if interval is None else interval.high,
            "sense": "at least" if self.at_least else "at most",
            "bound": self.bound if is_software or not self.software_only else None,
            "goal": self.goal,
            "reason": self.reason,
        }
        return {**entry, "passed": passes(entry)}


def passes(entry: Mapping[str, Any]) -> bool | None:
    """True if the bound of an entry holds; None: no bound.

    It fails if the better end of the interval misses it: a median alone may be the machine's noise.
    """
    if entry["bound"] is None:
        return None
    is_minimum = entry["sense"] == "at least"
    best = entry["high" if is_minimum else "low"]
    best = entry["value"] if best is None else best
    return bool(best >= entry["bound"] if is_minimum else best <= entry["bound"])


def reaches_goal(entry: Mapping[str, Any]) -> bool | None:
    """True if the value of an entry reaches its goal; None: no goal."""
    value, goal = entry["value"], entry["goal"]
    if goal is None:
        return None
    return bool(value >= goal if entry["sense"] == "at least" else value <= goal)


def goal_text(entry: Mapping[str, Any]) -> str:
    """`reached`, or the distance as a factor, or as a difference from zero; empty: no goal."""
    value, goal = entry["value"], entry["goal"]
    if goal is None:
        return ""
    if reaches_goal(entry):
        return "reached"
    if not value > 0.0 < goal:
        return f"{abs(value - goal):.3g} off"
    return f"{max(value / goal, goal / value):.3g} × off"


def entry_cells(entry: Mapping[str, Any]) -> tuple[str, str, str, str]:
    """Name, value with its interval, bound and goal of an entry, as text."""
    sign = "≥" if entry["sense"] == "at least" else "≤"
    value = _text(entry["value"])
    if entry["low"] is not None:
        value += f" ({_text(entry['low'])} – {_text(entry['high'])})"
    bound = goal = ""
    if entry["bound"] is not None:
        bound = f"{sign} {entry['bound']:g}: {'holds' if entry['passed'] else 'FAILS'}"
    if entry["goal"] is not None:
        goal = f"{sign} {entry['goal']:g}: {goal_text(entry)}"
    return entry["name"], value, bound, goal


def _text(value: float) -> str:
    """Number with three digits, or whole."""
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def is_number(value: object) -> bool:
    """True for a finite number."""
    return type(value) in (int, float) and math.isfinite(value)  # type: ignore[arg-type]
