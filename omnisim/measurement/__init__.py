"""Cameras measured from their own images: noise by EMVA 1288, sharpness by ISO 12233."""

from omnisim.measurement.quantity import Quantity, Unseen

__all__ = ["Quantity", "Unseen"]
