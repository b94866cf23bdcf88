"""Requests of the commands that create images and scans, or read an image."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, ClassVar

from omnisim.apps.cli import completion
from omnisim.apps.cli.option_groups import (
    CAMERA,
    GROUND_TRUTH,
    TRAJECTORY,
    BackendOptions,
    CameraFileOptions,
    DeviceOptions,
    FileUnitOptions,
    ImageOptions,
    LightOptions,
    MeshImageOptions,
    PoseAxes,
    Position,
    RobotName,
    SceneOptions,
    ShadowedLightOptions,
    TiltedViewpointOptions,
    TruthOptions,
    ViewpointOptions,
)
from omnisim.apps.cli.options import Argument, Option


@dataclass(frozen=True, kw_only=True)
class RigCameraOptions(CameraFileOptions):
    """Camera, or cameras along a trajectory."""

    robot: RobotName = None
    """Robot whose body is in the image, and whose camera is used unless another is chosen. With
    --trajectory, all of its sensors record, including IMUs and lidars."""
    camera_name: Annotated[
        str | None, Option(metavar="NAME|all", default="the first, or all with --trajectory")
    ] = None
    """Name of the camera in the calibration file."""


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """Motion and noise of one image."""

    panel: ClassVar[str] = CAMERA

    seed: int = 0
    """Seed of the camera's noise."""
    speed_mps: float = 0.0
    """Forward speed, for motion blur and rolling shutter."""
    turn_rate_degps: float = 0.0
    """Turn rate to the left, for motion blur and rolling shutter."""


@dataclass(frozen=True, kw_only=True)
class CameraViewpointOptions(TiltedViewpointOptions):
    """Viewpoint, or a camera of the scene's file."""

    at_camera: Annotated[str | None, Option(metavar="NAME")] = None
    """Camera of the scene's file that sets viewpoint, attitude and, unless another is chosen, the
    lens; `omnisim scene` lists them."""


@dataclass(frozen=True, kw_only=True)
class TrajectoryOptions:
    """Poses to render at, instead of one viewpoint."""

    panel: ClassVar[str] = TRAJECTORY

    trajectory: Path | None = None
    """Poses to render at, instead of one viewpoint: TUM, KITTI, EuRoC, .csv, or nerfstudio's
    transforms.json, which also sets the camera. --at, --yaw, --pitch and --roll place the file's
    origin in the scene; they default to 0."""
    trajectory_frame: Annotated[
        str | None,
        Option(metavar="body|camera|NAME", default="by the file's format, with a note"),
    ] = None
    """Frame that the poses describe: the rig's body, its first camera, or a named camera."""
    axes: Annotated[PoseAxes | None, Option(default="kitti for KITTI's files, else world")] = None
    """Axes of a file's poses: kitti (x right, y down, z ahead) or world (x forward, y left, z
    up)."""
    rate_hz: Annotated[float | None, Option(default="1, with a note")] = None
    """Poses per second of a trajectory without times."""


class OverlayKind(StrEnum):
    """Ground truth to draw on an image."""

    BOXES = "boxes"
    LABELS = "labels"

    @property
    def channel(self) -> str:
        """Channel that is needed."""
        return "instance" if self is OverlayKind.BOXES else "semantic"


@dataclass(frozen=True, kw_only=True)
class FlowOptions:
    """Other viewpoints of flow, previews and overlays."""

    panel: ClassVar[str] = GROUND_TRUTH

    next_at: Annotated[
        Position, Option(flags=("--next",), metavar="X Y Z", default="0.1 m ahead")
    ] = None
    """Viewpoint of the next frame, for flow."""
    next_yaw_deg: Annotated[float | None, Option(default="same as --yaw")] = None
    """Heading at the next viewpoint, for flow."""
    previous_at: Annotated[
        Position, Option(flags=("--previous",), metavar="X Y Z", default="0.1 m behind")
    ] = None
    """Viewpoint of the previous frame, for flow_backward."""
    previous_yaw_deg: Annotated[float | None, Option(default="same as --yaw")] = None
    """Heading at the previous viewpoint, for flow_backward."""
    interval_s: float = 0.0
    """Seconds between the frame and its neighbors, for the flow of moving objects."""
    preview: bool = False
    """Also write a preview image of each channel."""
    overlay: OverlayKind | None = None
    """Also write FILE.overlay.png: the image with boxes of the visible instances, or with the masks
    of the classes, and their names."""


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """Other files of one image."""

    faces: Annotated[Path | None, Option(metavar="DIR")] = None
    """Also write the virtual cameras' images into this folder."""
    rays: Path | None = None
    """Also write the ray of each pixel: .exr."""
    calibration: Path | None = None
    """Also write camera and pose: .json."""


@dataclass(frozen=True, kw_only=True)
class RenderRequest:
    """Parameters of `omnisim render`."""

    output: Annotated[Path, Option(metavar="FILE|DIR")]
    """Image: .png .jpg .tif (sRGB) or .exr (linear). With --trajectory: folder of the run; an
    unfinished run resumes."""
    force: bool = False
    """Overwrite an existing run in the folder."""
    light: ShadowedLightOptions
    files: FileOptions
    world: SceneOptions
    camera: RigCameraOptions
    image: MeshImageOptions
    motion: MotionOptions
    viewpoint: CameraViewpointOptions
    poses: TrajectoryOptions
    truth: TruthOptions
    flow: FlowOptions
    gpu: BackendOptions


@dataclass(frozen=True, kw_only=True)
class LiveSceneOptions(FileUnitOptions):
    """Scene of the live page."""

    scene: Annotated[
        str | None,
        Argument(metavar="[SCENE]", default="soccer", complete=completion.complete_scene),
    ] = None
    """Scene file, or name of a built-in scene."""


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Page and its server."""

    panel: ClassVar[str] = "Page"

    host: Annotated[str, Option(metavar="ADDRESS")] = "localhost"
    """Address to listen on; any address but this machine's own requires a token."""
    port: Annotated[int, Option(min=0, max=65535)] = 8080
    """Port to listen on; 0: any free port."""
    open: bool = False
    """Open the page in a browser."""
    record: Path | None = None
    """Record a short film of a drive around the start, without serving a page: .mp4 .mkv."""


@dataclass(frozen=True, kw_only=True)
class LiveRequest:
    """Parameters of `omnisim live`."""

    world: LiveSceneOptions
    robot: RobotName = None
    """Robot to drive, with its camera or another one; without a robot, the camera flies freely."""
    run: Annotated[Path | None, Option(metavar="DIR")] = None
    """Recorded run to replay, with its images."""
    light: LightOptions
    camera: CameraFileOptions
    image: ImageOptions
    viewpoint: ViewpointOptions
    page: PageOptions
    gpu: DeviceOptions


class ViewKind(StrEnum):
    """Projections of an unwarped view."""

    CYLINDER = "cylinder"
    PERSPECTIVE = "perspective"
    BIRDSEYE = "birdseye"


@dataclass(frozen=True, kw_only=True)
class ImageCameraOptions(CameraFileOptions):
    """Camera of an image, whose metadata may name it."""

    sensor: Annotated[Path | None, Option(default="the image's metadata")] = None
    """Sensor file: .toml."""


@dataclass(frozen=True, kw_only=True)
class UnwarpRequest:
    """Parameters of `omnisim unwarp`."""

    source: Annotated[Path, Argument(metavar="IMAGE")]
    """Image, by omnisim or any other source."""
    kind: Annotated[ViewKind, Option(flags=("--to",))]
    """View: a panorama, a pinhole camera's view, or a map of the ground."""
    output: Path
    """Image to write: .png .jpg .tif (sRGB) or .exr (linear)."""
    also: Annotated[
        str | None, Option(metavar="CHANNELS", complete=completion.complete_channels)
    ] = None
    """Ground-truth channels of the image to unwarp as well, comma-separated, or all."""
    channel_format: Annotated[
        str | None,
        Option(metavar="auto|npy|both", default="auto", names=lambda: ("auto", "npy", "both")),
    ] = None
    """Files of the channels: auto (EXR layers, or PNG and others), npy (one .npy each), or both."""
    camera: ImageCameraOptions
    size_px: Annotated[
        tuple[int, int] | None, Option(metavar="W H", default="matching the image's resolution")
    ] = None
    """Width and height of the view in pixels."""
    yaw_deg: float = 0.0
    """Heading of the view, counter-clockwise from the front."""
    pitch_deg: Annotated[float | None, Option(default="0")] = None
    """Perspective: downward tilt."""
    field_of_view_deg: Annotated[float | None, Option(flags=("--fov",), default="90")] = None
    """Perspective: horizontal field of view."""
    elevation_deg: Annotated[
        tuple[float, float] | None, Option(metavar="LOW HIGH", default="-45 to the highest visible")
    ] = None
    """Cylinder: elevations of the lowest and highest row in degrees above the horizon."""
    height_m: Annotated[float | None, Option(default="the image's z")] = None
    """Bird's eye: height of the viewpoint above the ground."""
    extent_m: Annotated[float | None, Option(default="4 × height")] = None
    """Bird's eye: distance from the map's center to its edge."""
    right_at: Annotated[float | None, Option(metavar="M", default="infinity")] = None
    """Non-central optics: distance at which points are unwarped exactly."""


class RangeMode(StrEnum):
    """Measuring modes of an LMS200, named by the unit of its ranges."""

    MM = "mm"
    CM = "cm"


@dataclass(frozen=True, kw_only=True)
class ScanRequest:
    """Parameters of `omnisim scan`."""

    world: SceneOptions
    output: Path
    """Ranges to write: .csv with beam, angle_deg, range_m."""
    plot: Path | None = None
    """Also plot the scan from above: .png .pdf .svg."""
    resolution_deg: float = 0.5
    """Angle between beams: 1 or 0.5 over 180°, or 0.25 over 100°."""
    mode: RangeMode = RangeMode.MM
    """Range and step: mm up to 8.19 m by 1 mm, cm up to 81.9 m by 1 cm."""
    noise: Annotated[bool, Option(flags=("--noise/--no-noise",))] = True
    """Apply the device's errors to the ranges."""
    seed: int = 0
    """Seed of the device's errors."""
    viewpoint: TiltedViewpointOptions
    gpu: DeviceOptions
