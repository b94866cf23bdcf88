"""Requests of `omnisim measure`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from omnisim.apps.cli import completion
from omnisim.apps.cli.option_groups import PoseAxes
from omnisim.apps.cli.options import Argument, Option


@dataclass(frozen=True, kw_only=True)
class MeasureNoiseRequest:
    """Parameters of `omnisim measure noise`."""

    dark: Annotated[Path, Argument(metavar="DARK")]
    """Folder of dark frames, with one folder per exposure, such as 2.5ms."""
    flat: Annotated[Path, Argument(metavar="FLAT")]
    """Folder of evenly lit frames, likewise, of three exposures or more."""
    output: Path
    """Sensor file to write: .toml; a report and the fixed pattern are written beside it."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file to add the noise to."""
    bit_depth: Annotated[int | None, Option(metavar="BITS", default="as the values use")] = None
    """Bits of the converter."""
    bayer: bool = False
    """The frames are a Bayer mosaic."""


@dataclass(frozen=True, kw_only=True)
class MeasureGeometryRequest:
    """Parameters of `omnisim measure geometry`."""

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Folder of images of a board, a video or a ROS bag; or corners: .csv with
    image,x_m,y_m,u_px,v_px."""
    output: Path
    """Sensor file to write: .toml; report, corners and a plot are written beside it."""
    board: Annotated[str | None, Option(metavar="BOARD", default="none, for corners")] = None
    """Board: 8x6:30mm (inner corners and square), charuco:9x7:30mm:22mm:5X5_100 (squares, square,
    marker, dictionary), aprilgrid:6x6:88mm:0.3 (tags, tag, spacing), or a Kalibr file (.yaml)."""
    size: Annotated[tuple[int, int] | None, Option(metavar="WIDTH HEIGHT", default="none")] = None
    """Size of the images, for corners from a file."""
    model: Annotated[list[str] | None, Option(metavar="MODEL", default="all that fit")] = None
    """Camera model to fit; repeatable: the best on held-out images is chosen."""
    optics: Annotated[Path | None, Option(default="none: a central camera")] = None
    """Optics file of a non-central camera, close to the true one; --free names what is fitted."""
    free: Annotated[list[str] | None, Option(metavar="KEY", default="none")] = None
    """Key of the optics file to fit, such as surfaces.0.tilt_deg; repeatable."""
    mirrored: bool = False
    """The camera looks into a mirror."""
    flat_board: bool = False
    """Take the board as exactly flat, and do not measure its shape."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file whose camera is replaced."""


@dataclass(frozen=True, kw_only=True)
class MeasureCompareRequest:
    """Parameters of `omnisim measure compare`."""

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Folder of images of a board or a scene, a video or a ROS bag."""
    sensor: Path
    """Sensor file of the camera; the board's measured shape is read from the report beside it."""
    output: Path
    """Folder to write: report.html, report.json and its figures."""
    board: Annotated[str | None, Option(metavar="BOARD", default="none: --scene")] = None
    """Board: 8x6:30mm, charuco:9x7:30mm:22mm:5X5_100, aprilgrid:6x6:88mm:0.3, or a Kalibr file
    (.yaml), as for omnisim measure geometry."""
    mirrored: bool = False
    """The camera looks into a mirror, and sees a board in it."""
    scene: Annotated[
        str | None,
        Option(metavar="SCENE", default="none: --board", complete=completion.complete_scene),
    ] = None
    """Scene in the images, instead of a board: a scene file, or name of a built-in scene."""
    trajectory: Annotated[Path | None, Option(default="none: --board")] = None
    """Pose of each image in the scene: TUM, .csv, KITTI, EuRoC or transforms.json; with the names
    of the images, such as a.png x y z qx qy qz qw, or one pose per image in their order."""
    trajectory_frame: Annotated[
        str | None, Option(metavar="body|camera", default="by the file's format, with a note")
    ] = None
    """Frame that the poses describe: the camera, or the vehicle on which it is mounted."""
    axes: Annotated[PoseAxes | None, Option(default="kitti for KITTI's files, else world")] = None
    """Axes of the poses, as for omnisim render --trajectory."""
    exposure_ev: Annotated[
        str | None, Option(metavar="EV|auto", default="the camera's", names=lambda: ("auto",))
    ] = None
    """Exposure of the twin, in stops, in a scene whose light is not that of the images."""


@dataclass(frozen=True, kw_only=True)
class MeasureResponseRequest:
    """Parameters of `omnisim measure response`."""

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Folder of images of a still scene, with one folder per exposure, such as 2.5ms."""
    output: Path
    """Sensor file to write: .toml; a report is written beside it."""
    flat: Annotated[Path | None, Option(default="none: no vignetting")] = None
    """Folder of images of an evenly lit surface, for the vignetting."""
    black: Annotated[float, Option(metavar="LEVEL", min=0.0, max=65535.0)] = 0.0
    """Level without light."""
    white: Annotated[float | None, Option(metavar="LEVEL", default="255 or 65535")] = None
    """Largest level, such as 4095 for 12 bits in files of 16 bits."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file to add response and vignetting to."""


@dataclass(frozen=True, kw_only=True)
class MeasureTimingRequest:
    """Parameters of `omnisim measure timing`."""

    images: Annotated[Path, Argument(metavar="FRAMES")]
    """Folder of frames of a still surface under a flickering lamp, or of a turning board; a video
    or a ROS bag."""
    output: Path
    """Sensor file to write: .toml; a report is written beside it."""
    flicker: Annotated[float | None, Option(metavar="HZ", default="none: a turning board")] = None
    """Frequency of the light: twice the mains', such as 100, or a driven LED's."""
    modulation: Annotated[float | None, Option(metavar="SHARE", default="unknown")] = None
    """Amplitude of the lamp's light over its mean, from 0 to 1, for the exposure time."""
    board: Annotated[str | None, Option(metavar="BOARD", default="none: a flickering lamp")] = None
    """Turning board, as for omnisim measure geometry, in consecutive frames."""
    frame_rate: Annotated[float | None, Option(metavar="HZ", default="none")] = None
    """Frames per second, of a turning board."""
    mirrored: bool = False
    """The camera looks into a mirror."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file to add readout and exposure to; its transfer function applies to frames under a
    lamp, its camera model to a board."""


@dataclass(frozen=True, kw_only=True)
class MeasureSharpnessRequest:
    """Parameters of `omnisim measure sharpness`."""

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Folder of images of slanted edges, linear: PNG, TIFF, PGM or EXR; or one image."""
    output: Path
    """Sensor file to write: .toml; a report is written beside it."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file of the camera to add point spread and lateral color to; its principal point is
    the center of the field."""
    corners: Annotated[Path | None, Option(default="all straight edges are measured")] = None
    """Corners of a board of squares in each image, as for optics calibrate: .csv."""
    response: Annotated[str | None, Option(metavar="srgb|GAMMA", default="the sensor file's")] = (
        None
    )
    """Encoding of the images, such as srgb or 2.2; 1: linear; if unknown: linear, with a check."""


@dataclass(frozen=True, kw_only=True)
class MeasurePlanRequest:
    """Parameters of `omnisim measure plan`."""

    plan: Annotated[Path, Argument(metavar="PLAN")]
    """Plan: .toml with a table of arguments for each part, such as [geometry]."""
    output: Path
    """Sensor file to write: .toml; the folder of the report is beside it, such as camera-report."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file to start from."""
