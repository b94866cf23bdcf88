"""The same images by other OpenGL drivers, within a bound: `python -m tests.drivers`."""
