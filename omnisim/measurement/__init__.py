"""Cameras measured from their own images: geometry, noise, response, sharpness, timing."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """Measured quantity."""

    name: str  # key of the sensor file, or a name in its style
    value: float  # measured value
    sigma: float  # standard deviation of `value`; NaN: unknown
    unit: str  # unit of `value` and `sigma`; "": a ratio
    basis: str  # description of the images and points behind the value


@dataclass(frozen=True)
class Unobservable:
    """Quantity that the images do not determine."""

    name: str  # key of the sensor file, or a name in its style
    reason: str  # shortcoming of the images, and the images that would determine the quantity
