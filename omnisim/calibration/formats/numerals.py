"""Numbers as texts that every reader takes for floats, and that keep their last bit."""

from __future__ import annotations

from collections.abc import Iterable


def yaml_float(value: float) -> str:
    """A float in YAML: with a point always, as YAML 1.1 takes 1e-05 for a word."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")


def yaml_floats(values: Iterable[float]) -> str:
    """A list of floats in YAML, on one line."""
    return "[" + ", ".join(map(yaml_float, values)) + "]"
