"""Cameras measured from their own images: geometry, noise, response, sharpness, timing."""

from omnisim.measurement.quantity import Quantity, Unseen

__all__ = ["Quantity", "Unseen"]
