"""Mirror profiles in CSV files: r_m, the distance from the axis, and z_m, the height."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.cameras.optics.shapes import Shape, TabulatedProfile
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError, SensorFileError, TrajectoryError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.trajectories.formats.parsed_trajectory import read_text_table

_COLUMNS = ["r_m", "z_m"]
_SAMPLES = 1 << 14  # number of samples along a profile
_NEAR, _MIN_SLOPE = 1e-6, 1e-3  # share of the radius; minimum slope there of a conical tip


def read_profile(path: Path, pointed: bool = False) -> TabulatedProfile:
    """Read a mirror profile.

    Args:
        path: CSV file with the columns r_m and z_m.
        pointed: True if the tip may be conical; False: the profile is level on the axis.

    Raises:
        SensorFileError: the file is invalid; names file, line, actual and expected value.
    """
    try:
        table = read_text_table(path)
        names = table.lines[0].cells
        if sorted(names) != _COLUMNS:
            raise SensorFileError(f"{path}: expected the columns r_m,z_m, got {','.join(names)}")
        numbers = table.without_header().numbers(names)
    except TrajectoryError as reason:
        raise SensorFileError(str(reason)) from None
    radii_m, heights_m = (numbers[:, names.index(name)] for name in _COLUMNS)
    try:
        return TabulatedProfile(radii_m, heights_m, pointed)
    except OpticsError as reason:
        raise SensorFileError(f"{path}: {reason}") from None


def write_profile(path: Path, radii_m: Floats, heights_m: Floats) -> None:
    """Write a mirror profile.

    Raises:
        OutputError: the file cannot be written.
    """
    rows = zip(radii_m.tolist(), heights_m.tolist(), strict=True)
    write_text(path, "r_m,z_m\n" + "".join(f"{r!r},{z!r}\n" for r, z in rows))


def evenly_along(shape: Shape, radius_m: float, shares: Floats) -> Floats:
    """Radii (n,) at given shares (n,) of the profile's length from the axis to a radius."""
    radii_m = np.linspace(0.0, radius_m, _SAMPLES)
    lengths_m = profile_lengths_m(shape, radii_m)
    radii: Floats = np.interp(shares * lengths_m[-1], lengths_m, radii_m)
    radii[shares == 1.0] = radius_m  # without rounding errors
    return radii


def profile_lengths_m(shape: Shape, radii_m: Floats) -> Floats:
    """Lengths (n,) along a profile, from the first of ascending radii (n,)."""
    steps_m = np.hypot(np.diff(radii_m), np.diff(shape.sag_m(radii_m)))
    return np.append(0.0, steps_m.cumsum())


class SampledProfile(NamedTuple):
    """Points on a shape's profile."""

    # radii_m, heights_m: (n,), starting on the axis
    radii_m: Floats
    heights_m: Floats
    pointed: bool  # True if the tip is conical
    # largest distance along the axis between the shape and the spline through the points, midway
    # between points
    deviation_m: float


def sampled(shape: Shape, radius_m: float, count: int) -> SampledProfile:
    """Sample a shape evenly along its profile, from the axis to a radius."""
    radii_m = evenly_along(shape, radius_m, np.linspace(0.0, 1.0, count))
    heights_m = shape.sag_m(radii_m)
    near_m = _NEAR * radius_m
    rise_m = shape.sag_m(np.array([near_m])) - heights_m[0]
    pointed = bool(abs(rise_m[0]) > _MIN_SLOPE * near_m)
    between_m = 0.5 * (radii_m[1:] + radii_m[:-1])
    spline = TabulatedProfile(radii_m, heights_m, pointed)
    deviation_m = np.abs(spline.sag_m(between_m) - shape.sag_m(between_m)).max()
    return SampledProfile(radii_m, heights_m, pointed, float(deviation_m))
