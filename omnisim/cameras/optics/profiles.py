"""Profiles of mirrors: sampled, in CSV files (r_m from the axis, z_m high), and designed.

A mirror is designed for a pinhole camera, from the desired incidence θ at each image radius. A ray
at β from the axis, tan β = r/z, leaves a mirror z(r) at θ from straight down if

    dz/dr = tan((θ − β)/2).

If θ is a function of the image radius and of the point on the mirror, this is an ordinary
differential equation from the vertex outwards.

Source: Chahl & Srinivasan, Applied Optics 36 (1997); equal angles per pixel: Ollis, Herman & Singh,
CMU-RI-TR-99-04 (1999); equal steps on the ground: Hicks & Bajcsy, CVPR 2000; Gaspar, Deccó, Okamoto
& Santos-Victor, constant resolution omnidirectional cameras (OMNIVIS 2002).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy  # its submodules load on first use

from omnisim.cameras.optics.shapes import Shape, TabulatedProfile
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError, SensorFileError, TrajectoryError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.toml_file import toml_text
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


POINTS = 501
_TOLERANCE = 1e-12
_MAX_RADIUS = 100.0  # maximum radius of a mirror, relative to the distance of its vertex


class DesignedProfile(NamedTuple):
    """Mirror profile in the mirror's own frame: the vertex is at (0, 0)."""

    radii_m: Floats
    heights_m: Floats


@dataclass(frozen=True)
class Design:
    """Distance and size of a mirror to be designed.

    Attributes:
        vertex_m: distance from the pinhole to the mirror's vertex.
        half_angle_deg: angle at the pinhole from the axis to the rim.

    Raises:
        OpticsError: a distance or angle is not possible for a mirror.
    """

    vertex_m: float
    half_angle_deg: float

    def __post_init__(self) -> None:
        if not 0.0 < self.vertex_m <= 1e3:
            raise OpticsError(f"design: distance: expected 0 to 1000 m, got {self.vertex_m:g}")
        if not 0.1 <= self.half_angle_deg <= 60.0:
            raise OpticsError(
                f"design: half_angle: expected 0.1° to 60°, got {self.half_angle_deg:g}°"
            )

    def equi_angular(self, theta_max_deg: float) -> DesignedProfile:
        """Mirror whose incidence θ is proportional to the image radius, with θ_max at the rim.

        Raises:
            OpticsError: a mirror of this size cannot reach θ_max.
        """
        if not self.half_angle_deg < theta_max_deg <= 150.0:
            raise OpticsError(
                f"design: theta_max: expected more than half_angle = {self.half_angle_deg:g}° and "
                f"at most 150°, got {theta_max_deg:g}°"
            )
        theta_max_rad = math.radians(theta_max_deg)
        return self._solved(lambda share, r_m, z_m: theta_max_rad * share)

    def equi_ground(self, height_m: float, range_m: float) -> DesignedProfile:
        """Mirror for which distance on flat ground is proportional to the image radius.

        Args:
            height_m: height of the pinhole above the ground.
            range_m: distance from the axis seen at the rim.

        Raises:
            OpticsError: the height is invalid, or the range needs no mirror.
        """
        if not 0.0 <= height_m <= 1e3:
            raise OpticsError(f"design: height: expected 0 to 1000 m, got {height_m:g}")
        least_m = self.vertex_m * math.tan(math.radians(self.half_angle_deg))
        if not least_m < range_m <= 1e5:
            raise OpticsError(
                f"design: range: expected more than {least_m:.3g} m, as a plane mirror shows, and "
                f"at most 100000 m, got {range_m:g}"
            )
        return self._solved(
            lambda share, r_m, z_m: math.atan2(range_m * share - r_m, height_m + z_m)
        )

    def system_toml(self, profile: str, size_px: int) -> str:
        """Optics file of a pinhole camera below the mirror, whose rim fills the image.

        Args:
            profile: name of the profile file, in the folder of the optics file.
            size_px: side of the square image.
        """
        focal_px = 0.5 * size_px / math.tan(math.radians(self.half_angle_deg))
        camera = {
            "model": "perspective",
            "width_px": size_px,
            "height_px": size_px,
            "focal_length_px": focal_px,
        }
        surface = {"shape": "table", "file": profile, "position_m": [0.0, 0.0, self.vertex_m]}
        return toml_text({"camera": camera, "surfaces": [surface]})

    def _solved(self, theta_rad: Callable[[float, float, float], float]) -> DesignedProfile:
        """Solve the differential equation for θ as a function of image radius, r and z."""
        rim_tangent = math.tan(math.radians(self.half_angle_deg))

        def slope(r_m: float, state: Floats) -> list[float]:
            z_m = float(state[0])
            beta = math.atan2(r_m, z_m)
            return [math.tan(0.5 * (theta_rad(r_m / z_m / rim_tangent, r_m, z_m) - beta))]

        def beyond_rim(r_m: float, state: Floats) -> float:
            return r_m / float(state[0]) - rim_tangent

        setattr(beyond_rim, "terminal", True)  # noqa: B010  as SciPy wants it
        solution = scipy.integrate.solve_ivp(
            slope,
            (0.0, _MAX_RADIUS * self.vertex_m),
            [self.vertex_m],
            method="DOP853",
            rtol=_TOLERANCE,
            atol=_TOLERANCE * self.vertex_m,
            dense_output=True,
            events=beyond_rim,
        )
        if solution.status != 1:
            raise OpticsError(
                f"design: half_angle: expected an angle that the mirror reaches within "
                f"{_MAX_RADIUS:g} distances, got {self.half_angle_deg:g}°"
            )
        assert solution.sol is not None
        radii_m = np.linspace(0.0, float(solution.t[-1]), POINTS)
        heights_m = solution.sol(radii_m)[0] - self.vertex_m
        heights_m[0] = 0.0
        return DesignedProfile(radii_m, heights_m)
