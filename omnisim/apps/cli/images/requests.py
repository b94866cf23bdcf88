"""Requests of the commands that create images and scans, or read an image."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from omnisim.apps.cli import completion
from omnisim.apps.cli import option_groups as groups
from omnisim.apps.cli.options import Argument, Option, command, options


@options
class MotionOptions:
    """Motion and noise of one image."""

    panel: ClassVar[str] = groups.CAMERA

    seed: int = 0
    """Seed of the camera's noise."""
    speed_mps: Annotated[float, Option(ge=-1e4, le=1e4)] = 0.0
    """Forward speed, for motion blur and rolling shutter."""
    turn_rate_degps: Annotated[float, Option(ge=-57295, le=57295)] = 0.0
    """Turn rate to the left, for motion blur and rolling shutter."""


@options
class CameraViewpointOptions(groups.TiltedViewpointOptions):
    """Viewpoint, or a camera of the scene's file."""

    at_camera: Annotated[str | None, Option(metavar="NAME")] = None
    """Camera of the scene file that sets viewpoint, attitude and, unless another is chosen, the
    lens; `omnisim scene` lists them."""


@options
class FlowOptions:
    """Other viewpoints of flow, previews and overlays."""

    panel: ClassVar[str] = groups.GROUND_TRUTH

    next_at: Annotated[groups.Position, Option(flags=("--next",), metavar="X Y Z")] = None
    """Viewpoint of the next frame, for flow. Default: 0.1 m ahead."""
    next_yaw_deg: float | None = None
    """Heading at the next viewpoint, for flow. Default: same as --yaw."""
    previous_at: Annotated[groups.Position, Option(flags=("--previous",), metavar="X Y Z")] = None
    """Viewpoint of the previous frame, for flow_backward. Default: 0.1 m behind."""
    previous_yaw_deg: float | None = None
    """Heading at the previous viewpoint, for flow_backward. Default: same as --yaw."""
    interval_s: groups.Seconds = 0.0
    """Seconds between the frame and its neighbors, for the flow of moving objects."""
    preview: bool = False
    """Also write a preview image of each channel."""
    overlay: Literal["boxes", "labels"] | None = None
    """Also write FILE.overlay.png: the image with boxes of the visible instances, or with the masks
    of the classes, and their names."""


@options
class FileOptions:
    """Other files of one image."""

    faces: Annotated[Path | None, Option(metavar="DIR")] = None
    """Also write the virtual cameras' images into this folder."""
    rays: Path | None = None
    """Also write the ray of each pixel: .exr."""
    calibration: Path | None = None
    """Also write camera and pose: .json."""


@command(
    "render", "images.render.run",
    elsewhere=dict.fromkeys(
        ("--trajectory", "--trajectory-frame", "--axes", "--rate", "--force"), "omnisim record"
    ),
    first="output sensor robot at yaw_deg size_px quality preset also backend",
)  # fmt: skip
class RenderRequest:
    """Render a frame, with ground truth.

    omnisim render soccer -o soccer.png
    omnisim render courtyard --at 0 0 1.2 --yaw 30 --also range,semantic -o courtyard.png
    """

    output: Path
    """Image: .png .jpg .tif (sRGB) or .exr (linear)."""
    light: groups.ShadowedLightOptions
    files: FileOptions
    world: groups.SceneOptions
    camera: groups.CameraFileOptions
    robot: groups.RobotName = None
    """Robot whose body is in the image, and whose camera is used unless another is chosen."""
    image: groups.MeshImageOptions
    motion: MotionOptions
    viewpoint: CameraViewpointOptions
    truth: groups.TruthOptions
    flow: FlowOptions
    statistics: bool = False
    """Also print how many triangles of the scene were submitted, drawn and seen in the image."""
    gpu: groups.BackendOptions


@options
class LiveSceneOptions(groups.FileUnitOptions):
    """Scene of the live page."""

    scene: Annotated[
        str | None, Argument(metavar="[SCENE]", complete=completion.complete_scene)
    ] = None
    """Scene file, or name of a built-in scene. Default: soccer."""


@options
class PageOptions:
    """Page and its server."""

    panel: ClassVar[str] = "Page"

    host: Annotated[str, Option(metavar="ADDRESS")] = "localhost"
    """Address to listen on; viewers need a token unless it is localhost."""
    port: Annotated[int, Option(ge=0, le=65535)] = 8080
    """Port to listen on; 0: any free port."""
    open: bool = False
    """Open the page in a browser."""
    record: Path | None = None
    """Record a short video of a drive around the start, without serving a page: .mp4 .mkv."""


@command("live", "images.live.run", first="robot run sensor at size_px preset sky record open port")
class LiveRequest:
    """Serve a live page: a camera in the browser, driven by keys, with all its parameters.

    omnisim live soccer --open
    omnisim live courtyard --robot p2at
    """

    world: LiveSceneOptions
    robot: groups.RobotName = None
    """Robot to drive, with its camera or another one; without a robot, the camera flies freely."""
    run: Annotated[Path | None, Option(metavar="DIR")] = None
    """Recorded run to replay, with its images."""
    light: groups.LightOptions
    camera: groups.CameraFileOptions
    image: groups.ImageOptions
    viewpoint: groups.ViewpointOptions
    page: PageOptions
    gpu: groups.DeviceOptions


@options
class ImageCameraOptions(groups.CameraFileOptions):
    """Camera of an image, whose metadata may name it."""

    sensor: Path | None = None
    """Sensor file: .toml. Default: the image's metadata."""


@command(
    "unwarp", "images.unwarp.run",
    first="kind output size_px yaw_deg pitch_deg field_of_view_deg height_m extent_m also sensor",
)  # fmt: skip
class UnwarpRequest:
    """Unwarp an omnidirectional image to a cylinder, a perspective view or a map.

    omnisim unwarp soccer.png --to cylinder -o cylinder.png
    omnisim unwarp soccer.png --to perspective --yaw 90 --fov 60 -o left.png
    """

    source: Annotated[Path, Argument(metavar="IMAGE")]
    """Image, from omnisim or any other source."""
    kind: Annotated[Literal["cylinder", "perspective", "birdseye"], Option(flags=("--to",))]
    """View: a panorama, a pinhole camera's view, or a map of the ground."""
    output: Path
    """Image to write: .png .jpg .tif (sRGB) or .exr (linear)."""
    also: Annotated[
        str | None, Option(metavar="CHANNELS", complete=completion.complete_channels)
    ] = None
    """Ground-truth channels of the image to unwarp as well, comma-separated, or all."""
    channel_format: groups.ChannelFiles = None
    camera: ImageCameraOptions
    size_px: Annotated[tuple[int, int] | None, Option(metavar="W H")] = None
    """Width and height of the view in pixels. Default: matching the image's resolution."""
    yaw_deg: float = 0.0
    """Heading of the view, counter-clockwise from the front."""
    pitch_deg: float | None = None
    """Perspective: downward tilt. Default: 0."""
    field_of_view_deg: Annotated[float | None, Option(flags=("--fov",))] = None
    """Perspective: horizontal field of view. Default: 90."""
    elevation_deg: Annotated[tuple[float, float] | None, Option(metavar="LOW HIGH")] = None
    """Cylinder: elevations of the lowest and highest row in degrees above the horizon. Default: -45
    to the highest visible, at most 60."""
    height_m: float | None = None
    """Bird's eye: height of the viewpoint above the ground. Default: the image's z."""
    extent_m: float | None = None
    """Bird's eye: distance from the map's center to its edge. Default: 4 × height."""
    right_at: Annotated[float | None, Option(metavar="M")] = None
    """Non-central optics: distance at which points are unwarped exactly. Default: infinity."""


@command("scan", "images.scan.run", first="output plot at yaw_deg resolution_deg mode noise seed")
class ScanRequest:
    """Simulate one scan of a laser scanner, a SICK LMS200.

    omnisim scan mapping -o scan.csv
    omnisim scan mapping --at 0 0 0.4 --resolution 1 --plot scan.png -o scan.csv
    """

    world: groups.SceneOptions
    output: Path
    """Ranges to write: .csv with beam, angle_deg, range_m."""
    plot: Path | None = None
    """Also plot the scan from above: .png .pdf .svg."""
    resolution_deg: float = 0.5
    """Angle between beams: 1 or 0.5 over 180°, or 0.25 over 100°."""
    mode: Literal["mm", "cm"] = "mm"
    """Range and resolution: mm (up to 8.19 m in 1 mm steps), or cm (up to 81.9 m in 1 cm steps)."""
    noise: Annotated[bool, Option(flags=("--noise/--no-noise",))] = True
    """Apply the device's errors to the ranges."""
    seed: int = 0
    """Seed of the device's errors."""
    viewpoint: groups.TiltedViewpointOptions
    gpu: groups.DeviceOptions
