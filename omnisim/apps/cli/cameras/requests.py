"""Requests of the camera commands: sensor files, mirrors, calibrations, optics."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from omnisim.apps.cli import completion
from omnisim.apps.cli.option_groups import Mirrored
from omnisim.apps.cli.options import Argument, Option

PROFILE_POINTS = 501
DESIGN_SIZE_PX = 720

SystemFile = Annotated[Path, Argument(metavar="SYSTEM")]
Distances = Annotated[list[float] | None, Option(metavar="M", default="0.3, 1 and 5")]
MoreDistances = Annotated[list[float] | None, Argument(metavar="M")]
Format = Annotated[
    str | None,
    Option(metavar="FORMAT", default="detected", names=completion.calibration_formats),
]
CameraName = Annotated[str | None, Option(metavar="NAME", default="the first")]


@dataclass(frozen=True, kw_only=True)
class MirrorRequest:
    """Parameters of `omnisim mirror`."""

    output: Path
    """Mesh (.glb .obj .ply) or profile (.csv) to write."""
    polygons: Annotated[
        int | None,
        Option(
            flags=("-n", "--polygons"),
            metavar="POLYGONS",
            default="as many as 0.1 px accuracy needs, or the sensor file's",
        ),
    ] = None
    """Number of polygons of the mesh."""
    sensor: Annotated[Path | None, Option(default="the paper's mirror")] = None
    """Sensor file: .toml."""
    optics: Path | None = None
    """Optics file, in place of a sensor file: .toml."""
    surface: int = 0
    """Index of the optics file's surface, from 0."""


@dataclass(frozen=True, kw_only=True)
class SensorRequest:
    """Parameters of `omnisim sensor`."""

    check: Path | None = None
    """Sensor file to check, instead of printing the default one."""


@dataclass(frozen=True, kw_only=True)
class ConvertRequest:
    """Parameters of `omnisim calibration convert`."""

    to: Annotated[str, Option(metavar="FORMAT", names=completion.calibration_formats)]
    """Format to write, one of `omnisim calibration formats`."""
    output: Path
    """Calibration file to write."""
    camera_name: CameraName = None
    """Name of the camera in the calibration file."""
    format: Format = None
    """Format of FILE."""
    model: Annotated[str | None, Option(metavar="MODEL", default="the same, or the nearest")] = None
    """Camera model to write."""
    mirrored: Mirrored = None
    """The camera of the calibration file looks into a mirror."""
    optics: Path | None = None
    """Optics file, in place of FILE, to which a central camera is fitted."""
    at_distance: Distances = None
    """Optics: distances of points for the residuals: --at-distance 0.3 1 5."""
    right_at: Annotated[float | None, Option(metavar="M", default="infinity")] = None
    """Optics: distance from the viewpoint of the points to fit."""
    source: Annotated[str | None, Argument(metavar="FILE")] = None
    """Calibration file, sensor file, or image by omnisim."""
    more_distances: MoreDistances = None
    """Further distances for --at-distance."""


@dataclass(frozen=True, kw_only=True)
class ShowRequest:
    """Parameters of `omnisim calibration show`."""

    source: Annotated[Path, Argument(metavar="FILE")]
    """Calibration file, sensor file, or image by omnisim."""
    camera_name: CameraName = None
    """Name of the camera in the calibration file."""
    format: Format = None
    """Format of FILE."""
    mirrored: Mirrored = None
    """The camera of the calibration file looks into a mirror."""


@dataclass(frozen=True, kw_only=True)
class OpticsCheckRequest:
    """Parameters of `omnisim optics check`."""

    system: SystemFile
    """Optics file: .toml."""
    at_distance: Distances = None
    """Distances of points from the viewpoint: --at-distance 0.3 1 5."""
    more_distances: MoreDistances = None
    """Further distances for --at-distance."""


@dataclass(frozen=True, kw_only=True)
class OpticsPlotRequest:
    """Parameters of `omnisim optics plot`."""

    system: SystemFile
    """Optics file: .toml."""
    output: Path
    """Plot to write: .png .pdf .svg."""


@dataclass(frozen=True, kw_only=True)
class OpticsRaysRequest:
    """Parameters of `omnisim optics rays`."""

    system: SystemFile
    """Optics file: .toml."""
    output: Path
    """Ray table to write: .exr with 32-bit floats."""
    color: Annotated[str | None, Option(metavar="R|G|B", default="the file's")] = None
    """Color whose wavelength is traced."""


@dataclass(frozen=True, kw_only=True)
class OpticsDesignRequest:
    """Parameters of `omnisim optics design`."""

    output: Path
    """Profile to write: .csv with r_m,z_m; or .toml for the whole system, with the profile beside
    it."""
    distance_m: float
    """Distance from the pinhole to the mirror's tip."""
    half_angle_deg: float
    """Angle at the pinhole from the axis to the rim."""
    equi_angular_deg: float | None = None
    """Constant angular resolution: the rim shows this angle from straight down."""
    equi_ground_m: float | None = None
    """Constant resolution on the ground: the rim shows this distance."""
    height_m: float | None = None
    """Height of the pinhole above the ground, for --equi-ground."""
    size_px: Annotated[int | None, Option(min=2, max=16384, default=str(DESIGN_SIZE_PX))] = None
    """Side of the square image of a .toml, which the rim fills."""


@dataclass(frozen=True, kw_only=True)
class OpticsProfileRequest:
    """Parameters of `omnisim optics profile`."""

    system: SystemFile
    """Optics file: .toml."""
    output: Path
    """Profile to write: .csv with r_m,z_m."""
    surface: int = 0
    """Index of the surface, from 0."""
    points: Annotated[int, Option(metavar="POINTS", min=4, max=100_000)] = PROFILE_POINTS
    """Number of points of the profile."""


@dataclass(frozen=True, kw_only=True)
class OpticsCalibrateRequest:
    """Parameters of `omnisim optics calibrate`."""

    system: SystemFile
    """Optics file: .toml."""
    corners: Annotated[Path, Argument(metavar="CORNERS")]
    """Corners of a flat board: .csv with image,x_m,y_m,u_px,v_px."""
    free: Annotated[str, Option(metavar="KEYS")]
    """Comma-separated keys of SYSTEM to fit, such as surfaces.0.decenter_m."""
    output: Path
    """Optics file to write: .toml."""
