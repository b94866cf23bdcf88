"""Checks of what is measured from images: noise, sharpness, camera models."""
