"""Measured number with its bound."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

Sense = Literal["at least", "at most"]


@dataclass(frozen=True)
class Measure:
    """Measured number with its bound.

    Attributes:
        name: name of the quantity.
        value: value; NaN: not measurable.
        unit: unit of value and bound; empty: none.
        bound: maximum accepted value; None: no bound.
        at_least: the bound is the minimum accepted value.
        paper: the paper's value, as text; empty: none.
        unmeasured: reason why the bound is neither held nor missed; empty: it is one of both.
    """

    name: str
    value: float
    unit: str = ""
    bound: float | None = None
    at_least: bool = False
    paper: str = ""
    unmeasured: str = ""

    @property
    def passed(self) -> bool | None:
        """True if the bound holds, False for NaN; None without a bound, and if unmeasured."""
        if self.bound is None or self.unmeasured:
            return None
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    @property
    def value_text(self) -> str:
        """Value with its unit: a count, or a number to four digits."""
        if math.isfinite(self.value):
            return self._text(self.value)
        return "–" if self.unmeasured else "not a number"

    @property
    def bound_text(self) -> str:
        """Bound with sign and unit; empty: no bound."""
        if self.bound is None:
            return ""
        return f"{'≥' if self.at_least else '≤'} {self._text(self.bound)}"

    def as_dict(self) -> dict[str, Any]:
        """JSON object."""
        sense: Sense = "at least" if self.at_least else "at most"
        return {
            "name": self.name,
            "value": self.value if math.isfinite(self.value) else None,
            "unit": self.unit,
            "bound": self.bound,
            "sense": sense,
            "passed": self.passed,
            "paper": self.paper,
            **({"unmeasured": self.unmeasured} if self.unmeasured else {}),
        }

    def _text(self, number: float) -> str:
        form = ".0f" if number == round(number) and abs(number) < 1e6 else ".4g"
        return f"{number:z{form}} {self.unit}".rstrip()
