"""Formats of trajectory files: one module each, with `read` and `lines`.

They raise a TrajectoryError that names file, line, actual and expected value.

Numbers are printed with nine digits after the point: nanometers, nanoseconds, and 1e-9 of a
quaternion or a degree. Values read back are within half a unit of the last digit; rotations, whose
numbers are normalized to length 1, are within one and a half. A timestamp since 1970 has a
resolution of 0.2 µs, the limit of a float64 in seconds.
"""
