"""Cameras measured from their own images."""

from omnisim.measurement.quantity import Quantity, Unseen

__all__ = ["Quantity", "Unseen"]
