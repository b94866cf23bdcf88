"""Profiles in CSV files: r_m, the distance from the axis, and z_m, the height."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from omnisim.atomic_file import write_text
from omnisim.errors import OpticsError, SensorFileError, TrajectoryError
from omnisim.optics.shapes import Shape, TabulatedProfile
from omnisim.optics.shapes.shape import Floats
from omnisim.trajectories.formats.text_table import read_text_table

_COLUMNS = ["r_m", "z_m"]


def read_profile(path: Path, pointed: bool = False) -> TabulatedProfile:
    """Read a profile.

    Args:
        path: CSV file with the columns r_m and z_m.
        pointed: the tip may be a cone's; else the profile is level on its axis.

    Raises:
        SensorFileError: naming file, line, what was found and expected.
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
    """Write a profile.

    Raises:
        OutputError: the file cannot be written.
    """
    rows = zip(radii_m.tolist(), heights_m.tolist(), strict=True)
    write_text(path, "r_m,z_m\n" + "".join(f"{r!r},{z!r}\n" for r, z in rows))


def sampled(shape: Shape, radius_m: float, count: int) -> tuple[Floats, Floats]:
    """Radii and heights (count,) of a shape from its axis to a radius."""
    radii_m = np.linspace(0.0, radius_m, count)
    return radii_m, shape.sag_m(radii_m)
