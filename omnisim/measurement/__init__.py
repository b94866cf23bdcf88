"""Cameras measured from their own images: geometry, noise, response, sharpness, timing."""

from omnisim.measurement.quantity import Quantity, Unobservable

__all__ = ["Quantity", "Unobservable"]
