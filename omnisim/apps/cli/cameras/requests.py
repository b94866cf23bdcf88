"""Requests of the camera commands: sensor files, mirrors, calibrations, optics."""

from pathlib import Path
from typing import Annotated, Literal

from omnisim.apps.cli.completion import complete_camera, names_of
from omnisim.apps.cli.option_groups import CameraName, Mirrored
from omnisim.apps.cli.options import Argument, Option, command

PROFILE_POINTS = 501
DESIGN_SIZE_PX = 720

_formats = names_of("cameras.calibration.calibration_formats.FORMATS")
SystemFile = Annotated[Path, Argument(metavar="SYSTEM", help="Optics file: .toml.")]
Distances = Annotated[
    list[float] | None,
    Option(
        metavar="M",
        help="Optics: distances of points from the viewpoint: --at-distance 0.3 1 5. Default: 0.3, "
        "1 and 5.",
    ),
]
MoreDistances = Annotated[
    list[float] | None, Argument(metavar="M", help="Further distances for --at-distance.")
]
Format = Annotated[
    str | None, Option(metavar="FORMAT", names=_formats, help="Format of FILE. Default: detected.")
]


@command("mirror", "cameras.mirror.run")
class MirrorRequest:
    """Write the mirror's mesh, with texture coordinates on the unfolded cube, for Blender.

    omnisim mirror -o mirror.glb
    omnisim mirror --sensor sensor.toml -n 3600 -o mirror.obj
    """

    output: Path
    """Mesh (.glb .obj .ply) or profile (.csv) to write."""
    polygons: Annotated[int | None, Option(flags=("-n", "--polygons"), metavar="POLYGONS")] = None
    """Number of polygons of the mesh. Default: as many as 0.1 px accuracy needs, or the sensor
    file's."""
    sensor: Path | None = None
    """Sensor file: .toml. Default: the paper's mirror."""
    optics: Path | None = None
    """Optics file, in place of a sensor file: .toml."""
    surface: int = 0
    """Index of the optics file's surface, from 0."""


@command("sensor", "cameras.sensor.run")
class SensorRequest:
    """Print the default sensor file with a comment per key, or check a sensor file.

    omnisim sensor
    omnisim sensor --check sensor.toml
    """

    check: Path | None = None
    """Sensor file to check, instead of printing the default one."""


@command("calibration convert", "cameras.calibration.convert")
class ConvertRequest:
    """Convert a calibration to another format, exactly or by the best fit, with its residual.

    omnisim calibration convert kalibr.yaml --to opencv_fisheye -o opencv.yaml
    omnisim calibration convert --optics mirror.toml --to kalibr -o kalibr.yaml
    """

    to: Annotated[str, Option(metavar="FORMAT", names=_formats)]
    """Format to write, one of `omnisim calibration formats`."""
    output: Path
    """Calibration file to write."""
    camera_name: CameraName = None
    format: Format = None
    model: Annotated[str | None, Option(metavar="MODEL")] = None
    """Camera model to write. Default: the same, or the nearest."""
    mirrored: Mirrored = None
    optics: Path | None = None
    """Optics file, in place of FILE, to which a central camera is fitted."""
    at_distance: Distances = None
    right_at: Annotated[float | None, Option(metavar="M")] = None
    """Optics: distance of the fitted points from the viewpoint. Default: infinity."""
    source: Annotated[str | None, Argument(metavar="FILE", complete=complete_camera)] = None
    """Calibration file, sensor file, or image by omnisim."""
    more_distances: MoreDistances = None


@command("calibration show", "cameras.calibration.show")
class ShowRequest:
    """Show the cameras of a calibration file: model, parameters, field of view, valid domain.

    omnisim calibration show kalibr.yaml
    omnisim calibration show kalibr.yaml --camera-name cam1
    """

    source: Annotated[Path, Argument(metavar="FILE", complete=complete_camera)]
    """Calibration file, sensor file, or image by omnisim."""
    camera_name: CameraName = None
    format: Format = None
    mirrored: Mirrored = None


@command("calibration check", "cameras.check_calibration.check")
class CalibrationCheckRequest:
    """Check a calibration: lens, field, rig, and what other formats make of it; exits with 1 if it
    contradicts itself.

    omnisim calibration check kalibr.yaml
    omnisim calibration check kalibr.yaml photo.png --camera-name cam0 -o check
    """

    source: Annotated[Path, Argument(metavar="FILE")]
    """Calibration file, sensor file, or image by omnisim."""
    images: Annotated[list[Path] | None, Argument(metavar="IMAGE")] = None
    """Images of the camera, to be drawn with lines that are straight in the world."""
    output: Annotated[Path | None, Option(metavar="DIR")] = None
    """Folder for the plots: check.png, and one of each image. Default: none."""
    camera_name: CameraName = None
    format: Format = None
    mirrored: Mirrored = None
    json: bool = False
    """Print only JSON, with all findings."""


@command("calibration search", "cameras.calibration.search")
class SearchRequest:
    """Search the catalog of measured cameras; --camera catalog:NAME takes one.

    omnisim calibration search "hero 11 wide"
    omnisim calibration search dji action 4k --limit 0
    """

    words: Annotated[list[str], Argument(metavar="WORD")]
    """Maker, model, lens, mode or image size, such as 4k; each may be a beginning."""
    limit: Annotated[int, Option(metavar="COUNT")] = 20
    """Number of cameras to list; 0: all."""


@command("optics check", "cameras.optics.check")
class OpticsCheckRequest:
    """Check an optical system, and measure the errors of its central approximation by distance.

    omnisim optics check mirror.toml
    omnisim optics check mirror.toml --at-distance 0.3 1 5
    """

    system: SystemFile
    at_distance: Distances = None
    more_distances: MoreDistances = None


@command("optics plot", "cameras.optics.plot", extra="plots")
class OpticsPlotRequest:
    """Plot an optical system: profile, rays, caustic, resolution by image radius.

    omnisim optics plot mirror.toml -o mirror.png
    omnisim optics plot mirror.toml -o mirror.pdf
    """

    system: SystemFile
    output: Path
    """Plot to write: .png .pdf .svg."""


@command("optics rays", "cameras.optics.rays")
class OpticsRaysRequest:
    """Write the ray of each pixel, origin and direction, as a table.

    omnisim optics rays mirror.toml -o rays.exr
    omnisim optics rays mirror.toml --color B -o blue.exr
    """

    system: SystemFile
    output: Path
    """Ray table to write: .exr with 32-bit floats."""
    color: Literal["R", "G", "B"] | None = None
    """Color whose wavelength is traced. Default: the file's."""


@command("optics design", "cameras.optics.design")
class OpticsDesignRequest:
    """Design a mirror's profile: constant resolution by angle, or on the ground.

    omnisim optics design --distance 0.1 --half-angle 20 --equi-angular 105 -o mirror.toml
    omnisim optics design --distance 0.1 --half-angle 20 --equi-ground 5 --height 1 -o profile.csv
    """

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
    size_px: Annotated[int | None, Option(ge=2, le=16384)] = None
    """Side of the square image of a .toml, which the rim fills. Default: 720."""


@command("optics profile", "cameras.optics.profile")
class OpticsProfileRequest:
    """Write the profile of a surface, for a lathe.

    omnisim optics profile mirror.toml -o profile.csv
    omnisim optics profile mirror.toml --surface 1 --points 2001 -o second.csv
    """

    system: SystemFile
    output: Path
    """Profile to write: .csv with r_m,z_m."""
    surface: int = 0
    """Index of the surface, from 0."""
    points: Annotated[int, Option(metavar="POINTS", ge=4, le=100_000)] = PROFILE_POINTS
    """Number of points of the profile."""


@command("optics calibrate", "cameras.optics.calibrate")
class OpticsCalibrateRequest:
    """Fit an optical system's parameters to the corners of a board in images.

    omnisim optics calibrate mirror.toml corners.csv --free surfaces.0.decenter_m -o fitted.toml
    omnisim optics calibrate mirror.toml corners.csv --free camera.focal_length_px -o fitted.toml
    """

    system: SystemFile
    corners: Annotated[Path, Argument(metavar="CORNERS")]
    """Corners of a flat board: .csv with image,x_m,y_m,u_px,v_px."""
    free: Annotated[str, Option(metavar="KEYS")]
    """Comma-separated keys of SYSTEM to fit, such as surfaces.0.decenter_m."""
    output: Path
    """Optics file to write: .toml."""


@command("calibration formats", "cameras.calibration.list_formats")
class FormatsRequest:
    """List the formats, and the camera models that each represents exactly.

    omnisim calibration formats
    """
