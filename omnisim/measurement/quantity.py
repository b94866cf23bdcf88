"""Measured quantities of a camera, each with its uncertainty and the data behind it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """Measured quantity.

    Attributes:
        name: key of the sensor file, or a name in its style.
        value: measured value.
        sigma: standard deviation of `value`; NaN: unknown.
        unit: unit of `value` and `sigma`; "": a ratio.
        basis: description of the images and points behind the value.
    """

    name: str
    value: float
    sigma: float
    unit: str
    basis: str


@dataclass(frozen=True)
class Unobservable:
    """Quantity that the images do not determine.

    Attributes:
        name: key of the sensor file, or a name in its style.
        reason: shortcoming of the images, and the images that would determine the quantity.
    """

    name: str
    reason: str
