"""Validation of camera parameters, in dataclasses and in external mappings.

Errors name the key, the expected value and the actual one.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from omnisim.core.errors import OpticsError

MAX_COEFFICIENT = 1e60  # still finite when multiplied by a power of a radius


def check_limits(
    camera: object, name: str, lowest: float, highest: float, expected: str | None = None
) -> None:
    """Reject a camera whose attribute `name` is outside [lowest, highest], or NaN.

    Raises:
        OpticsError: the attribute is outside; names it, its value and the limits.
    """
    value = getattr(camera, name)
    if not lowest <= value <= highest:  # also rejects NaN
        expected = expected or f"{lowest:g} to {highest:g}"
        raise OpticsError(f"camera: {name}: expected {expected}, got {value:g}")


def number(parameters: Mapping[str, Any], key: str) -> float:
    """Finite number under `key`.

    Raises:
        OpticsError: the value is missing, or is not a finite number.
    """
    value = _value(parameters, key)
    if type(value) not in (int, float):
        raise _unexpected(key, "a number", value)
    # an integer may be too large for a float; NaN is within no limits
    if not abs(value) <= sys.float_info.max:
        raise _unexpected(key, "a finite number", value)
    return float(value)


def whole_number(parameters: Mapping[str, Any], key: str) -> int:
    """Integer under `key`.

    Raises:
        OpticsError: the value is missing, or is not an integer.
    """
    value = _value(parameters, key)
    if type(value) is not int:
        raise _unexpected(key, "a whole number", value)
    return value


def point(parameters: Mapping[str, Any], key: str) -> tuple[float, float]:
    """Two finite numbers under `key`.

    Raises:
        OpticsError: the value is missing, or is not a pair of finite numbers.
    """
    value = _value(parameters, key)
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise _unexpected(key, "[u, v]", value)
    return number({key: value[0]}, key), number({key: value[1]}, key)


def numbers(parameters: Mapping[str, Any], key: str) -> tuple[float, ...]:
    """List of coefficients under `key`.

    Raises:
        OpticsError: the value is missing, is not a list of numbers, or has one that is too large.
    """
    value = _value(parameters, key)
    if not isinstance(value, list | tuple):
        raise _unexpected(key, "a list of numbers", value)
    coefficients = tuple(number({key: one}, key) for one in value)
    if coefficients and max(map(abs, coefficients)) > MAX_COEFFICIENT:
        raise _unexpected(key, f"numbers up to {MAX_COEFFICIENT:g}", value)
    return coefficients


def text(parameters: Mapping[str, Any], key: str) -> str:
    """String under `key`.

    Raises:
        OpticsError: the value is missing, or is not a string.
    """
    value = _value(parameters, key)
    if not isinstance(value, str):
        raise _unexpected(key, "a word", value)
    return value


def _value(parameters: Mapping[str, Any], key: str) -> Any:
    if key not in parameters:
        raise OpticsError(f"camera: {key}: missing")
    value = parameters[key]
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _unexpected(key: str, expected: str, value: object) -> OpticsError:
    return OpticsError(f"camera: {key}: expected {expected}, got {value!r}")
