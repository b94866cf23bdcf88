"""Commands for cameras and optics."""
