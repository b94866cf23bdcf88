"""Checks of quantities measured from images: noise, sharpness, camera models."""
