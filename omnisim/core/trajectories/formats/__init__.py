"""Formats of trajectory files: one module each, with `read` and `lines`.

Numbers are printed with nine digits after the point: nanometers, nanoseconds, and 1e-9 of a
quaternion or a degree. What is read back is within half a unit of the last digit; a rotation, whose
numbers are brought back to length 1, within one and a half. A stamp since 1970 is known to 0.2 µs:
a float64 of seconds has no more.
"""
