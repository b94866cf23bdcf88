"""Requests of `omnisim measure`."""

from pathlib import Path
from typing import Annotated

from omnisim.apps.cli import completion
from omnisim.apps.cli.option_groups import Axes, Exposure
from omnisim.apps.cli.options import Argument, Option, command


@command("measure noise", "measure.measure_sensor.noise")
class MeasureNoiseRequest:
    """Measure gain, noise and fixed pattern from dark frames and flat fields.

    omnisim measure noise dark flat -o camera.toml
    omnisim measure noise dark flat --sensor camera.toml --bit-depth 12 -o camera.toml
    """

    dark: Annotated[Path, Argument(metavar="DARK")]
    """Folder of dark frames, with a subfolder per exposure time, such as 2.5ms."""
    flat: Annotated[Path, Argument(metavar="FLAT")]
    """Folder of flat fields, with a subfolder for each of three or more exposure times."""
    output: Path
    """Sensor file to write: .toml; a report and the fixed pattern are written beside it."""
    sensor: Path | None = None
    """Sensor file to add the noise to. Default: none."""
    bit_depth: Annotated[int | None, Option(metavar="BITS")] = None
    """Bit depth of the A/D converter. Default: the bits that the values use."""
    bayer: bool = False
    """The frames are a Bayer mosaic."""


@command("measure geometry", "measure.measure_geometry.geometry")
class MeasureGeometryRequest:
    """Measure a camera's model from images of a calibration board.

    omnisim measure geometry images --board 8x6:30mm -o camera.toml
    omnisim measure geometry images --board board.yaml --model kannala_brandt -o camera.toml
    """

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Images of a board: a folder, a video or a ROS bag; or its corners: .csv with
    image,x_m,y_m,u_px,v_px."""
    output: Path
    """Sensor file to write: .toml; report, corners and a plot are written beside it."""
    board: Annotated[str | None, Option(metavar="BOARD")] = None
    """Board: 8x6:30mm (inner corners and square), charuco:9x7:30mm:22mm:5X5_100 (squares, square,
    marker, dictionary), aprilgrid:6x6:88mm:0.3 (tags, tag, spacing), or a Kalibr file (.yaml).
    Default: none, for corners."""
    size: Annotated[tuple[int, int] | None, Option(metavar="WIDTH HEIGHT")] = None
    """Size of the images, for corners from a file. Default: none."""
    model: Annotated[list[str] | None, Option(metavar="MODEL")] = None
    """Camera model to fit; repeatable: the best on held-out images is chosen. Default: all that
    fit."""
    optics: Path | None = None
    """Optics file of a non-central camera, close to the true one; --free names what is fitted.
    Default: none (a central camera)."""
    free: Annotated[list[str] | None, Option(metavar="KEY")] = None
    """Key of the optics file to fit, such as surfaces.0.tilt_deg; repeatable. Default: none."""
    mirrored: bool = False
    """The camera looks into a mirror."""
    flat_board: bool = False
    """Assume an exactly flat board, instead of measuring its shape."""
    sensor: Path | None = None
    """Sensor file whose camera is replaced. Default: none."""


@command("measure compare", "measure.measure_compare.compare")
class MeasureCompareRequest:
    """Compare a camera's images of a board or a scene with images rendered from its sensor file.

    omnisim measure compare images --sensor camera.toml --board 8x6:30mm -o report
    omnisim measure compare images --sensor camera.toml --scene hall.glb --trajectory a.tum -o out
    """

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Images of a board or a scene: a folder, a video or a ROS bag."""
    sensor: Path
    """Sensor file of the camera; the board's measured shape is read from the report beside it."""
    output: Path
    """Folder to write: report.html, report.json and its figures."""
    board: Annotated[str | None, Option(metavar="BOARD")] = None
    """Board: 8x6:30mm, charuco:9x7:30mm:22mm:5X5_100, aprilgrid:6x6:88mm:0.3, or a Kalibr file
    (.yaml), as for omnisim measure geometry. Default: none (--scene)."""
    mirrored: bool = False
    """The camera sees the board in a mirror."""
    scene: Annotated[str | None, Option(metavar="SCENE", complete=completion.complete_scene)] = None
    """Scene in the images, instead of a board: a scene file, or name of a built-in scene. Default:
    none (--board)."""
    trajectory: Path | None = None
    """Pose of each image in the scene: TUM, .csv, KITTI, EuRoC or transforms.json; with the names
    of the images, such as a.png x y z qx qy qz qw, or one pose per image in their order. Default:
    none (--board)."""
    trajectory_frame: Annotated[str | None, Option(metavar="body|camera")] = None
    """Frame that the poses describe: the camera, or the vehicle on which it is mounted. Default: by
    the file's format, with a note."""
    axes: Axes = None
    exposure_ev: Exposure = None
    """Exposure of the twin, in stops, if the scene's light differs from the images'. Default: the
    camera's."""


@command("measure response", "measure.measure_sensor.response")
class MeasureResponseRequest:
    """Measure response and vignetting from exposure series and flat fields.

    omnisim measure response series -o camera.toml
    omnisim measure response series --flat flat --sensor camera.toml -o camera.toml
    """

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Folder of images of a static scene, with a subfolder per exposure time, such as 2.5ms."""
    output: Path
    """Sensor file to write: .toml; a report is written beside it."""
    flat: Annotated[Path | None, Option(metavar="DIR")] = None
    """Folder of images of an evenly lit surface, to measure vignetting. Default: none."""
    black: Annotated[float, Option(metavar="LEVEL", ge=0.0, le=65535.0)] = 0.0
    """Gray level without light."""
    white: Annotated[float | None, Option(metavar="LEVEL")] = None
    """Maximum gray level, such as 4095 for 12 bits in 16-bit files. Default: 255 or 65535."""
    sensor: Path | None = None
    """Sensor file to add response and vignetting to. Default: none."""


@command("measure timing", "measure.measure_sensor.timing")
class MeasureTimingRequest:
    """Measure readout and exposure from a flickering lamp or a turning board.

    omnisim measure timing frames --flicker 100 -o camera.toml
    omnisim measure timing frames --board 8x6:30mm --frame-rate 30 --sensor a.toml -o b.toml
    """

    images: Annotated[Path, Argument(metavar="FRAMES")]
    """Frames of a static surface under a flickering lamp, or of a turning board: a folder, a video
    or a ROS bag."""
    output: Path
    """Sensor file to write: .toml; a report is written beside it."""
    flicker: Annotated[float | None, Option(metavar="HZ")] = None
    """Frequency of the light: twice the mains', such as 100, or a driven LED's. Default: none (a
    turning board)."""
    modulation: Annotated[float | None, Option(metavar="SHARE")] = None
    """Amplitude of the lamp's light over its mean, from 0 to 1, for the exposure time. Default:
    unknown."""
    board: Annotated[str | None, Option(metavar="BOARD")] = None
    """Turning board, as for omnisim measure geometry, in consecutive frames. Default: none (a
    flickering lamp)."""
    frame_rate: Annotated[float | None, Option(metavar="HZ")] = None
    """Frame rate, for a turning board. Default: none."""
    mirrored: bool = False
    """The camera looks into a mirror."""
    sensor: Path | None = None
    """Sensor file to add readout and exposure to; its transfer function applies to frames under a
    lamp, its camera model to a board. Default: none."""


@command("measure sharpness", "measure.measure_sensor.sharpness")
class MeasureSharpnessRequest:
    """Measure point spread and lateral color over the field from slanted edges.

    omnisim measure sharpness images --sensor camera.toml -o camera.toml
    omnisim measure sharpness edges.png --response srgb -o camera.toml
    """

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Folder of linear images of slanted edges (PNG, TIFF, PGM or EXR), or one image."""
    output: Path
    """Sensor file to write: .toml; a report is written beside it."""
    sensor: Path | None = None
    """Sensor file of the camera to add point spread and lateral color to; its principal point is
    the center of the field. Default: none."""
    corners: Path | None = None
    """Corners of a board of squares in each image, as for optics calibrate: .csv. Default: none
    (all straight edges are measured)."""
    response: Annotated[str | None, Option(metavar="srgb|GAMMA")] = None
    """Encoding of the images: srgb, or a gamma such as 2.2 (1: linear). Default: the sensor file's,
    else linear, with a check."""


@command("measure plan", "measure.measure_plan.plan")
class MeasurePlanRequest:
    """Measure a camera according to a plan, and write a report.

    omnisim measure plan plan.toml -o camera.toml
    omnisim measure plan plan.toml --sensor before.toml -o camera.toml
    """

    plan: Annotated[Path, Argument(metavar="PLAN")]
    """Plan: .toml with a table of arguments for each part, such as [geometry]."""
    output: Path
    """Sensor file to write: .toml; the folder of the report is beside it, such as camera-report."""
    sensor: Path | None = None
    """Sensor file to start from. Default: none."""
