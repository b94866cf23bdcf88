"""Commands of cameras and optics."""
