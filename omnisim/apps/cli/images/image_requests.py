"""Parameters of the commands that take or change an image, or take a scan."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import (
    CAMERA,
    GROUND_TRUTH,
    AlsoOption,
    AtCameraOption,
    AtOption,
    AxesOption,
    Backend,
    BackendOption,
    BakedOption,
    Boxes3dOption,
    CalibrationOption,
    ChannelFormatOption,
    DeviceOption,
    ForceOption,
    ImageOption,
    LabelsOption,
    MirroredOption,
    NoShadowsOption,
    OpticsOption,
    PitchOption,
    PolygonsOption,
    PresetOption,
    QualityOption,
    ResourcesOption,
    RollOption,
    SceneArgument,
    SensorOption,
    SizeOption,
    SkyOption,
    TimeOption,
    UnitOption,
    UnlitOption,
    UpOption,
    YawOption,
)
from omnisim.apps.cli.completion import complete_channels, complete_robot
from omnisim.apps.cli.images.trajectory_arguments import (
    ImageOrRunOption,
    RigCameraOption,
    TrajectoryFrameOption,
    TrajectoryOption,
    TrajectoryRateOption,
)


@dataclass(frozen=True)
class RenderRequest:
    """Parameters of `omnisim render`."""

    scene: SceneArgument
    output: ImageOrRunOption
    sensor: SensorOption = None
    optics: OpticsOption = None
    camera: CalibrationOption = None
    camera_name: RigCameraOption = None
    mirrored: MirroredOption = None
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="NAME|FILE",
            autocompletion=complete_robot,
            help="Robot whose body is in the image, and whose camera takes it where no other is "
            "given; with --trajectory all of its sensors record, also its IMUs and lidars.",
            rich_help_panel=CAMERA,
        ),
    ] = None
    trajectory: TrajectoryOption = None
    trajectory_frame: TrajectoryFrameOption = None
    axes: AxesOption = None
    rate_hz: TrajectoryRateOption = None
    force: ForceOption = False
    at: AtOption = None
    at_camera: AtCameraOption = None
    yaw_deg: YawOption = None
    pitch_deg: PitchOption = 0.0
    roll_deg: RollOption = 0.0
    time_s: TimeOption = 0.0
    polygons: PolygonsOption = None
    size_px: SizeOption = None
    quality: QualityOption = None
    unlit: UnlitOption = False
    no_shadows: NoShadowsOption = False
    sky: SkyOption = None
    baked: BakedOption = None
    faces: Annotated[
        Path | None,
        typer.Option(
            "--faces",
            metavar="DIR",
            help="Also write the virtual cameras' images into this folder.",
        ),
    ] = None
    also: AlsoOption = None
    channel_format: ChannelFormatOption = None
    boxes_3d: Boxes3dOption = False
    labels: LabelsOption = None
    next_at: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            "--next",
            metavar="X Y Z",
            help="Viewpoint of the next frame, for flow.",
            show_default="0.1 m ahead",
            rich_help_panel=GROUND_TRUTH,
        ),
    ] = None
    next_yaw_deg: Annotated[
        float | None,
        typer.Option(
            "--next-yaw",
            metavar="DEG",
            help="Heading at the next viewpoint, for flow.",
            show_default="that of --yaw",
            rich_help_panel=GROUND_TRUTH,
        ),
    ] = None
    previous_at: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            "--previous",
            metavar="X Y Z",
            help="Viewpoint of the previous frame, for flow_backward.",
            show_default="0.1 m behind",
            rich_help_panel=GROUND_TRUTH,
        ),
    ] = None
    previous_yaw_deg: Annotated[
        float | None,
        typer.Option(
            "--previous-yaw",
            metavar="DEG",
            help="Heading at the previous viewpoint, for flow_backward.",
            show_default="that of --yaw",
            rich_help_panel=GROUND_TRUTH,
        ),
    ] = None
    interval_s: Annotated[
        float,
        typer.Option(
            "--interval",
            metavar="S",
            help="Seconds to the next frame and from the previous, for flow of what moves.",
            rich_help_panel=GROUND_TRUTH,
        ),
    ] = 0.0
    preview: Annotated[
        bool,
        typer.Option(
            "--preview",
            help="Also write a preview image of each channel.",
            rich_help_panel=GROUND_TRUTH,
        ),
    ] = False
    preset: PresetOption = None
    seed: Annotated[
        int,
        typer.Option(
            "--seed", metavar="N", help="Seed of the camera's noise.", rich_help_panel=CAMERA
        ),
    ] = 0
    speed_mps: Annotated[
        float,
        typer.Option(
            "--speed",
            metavar="M/S",
            help="Speed ahead, for motion blur and rolling shutter.",
            rich_help_panel=CAMERA,
        ),
    ] = 0.0
    turn_rate_degps: Annotated[
        float,
        typer.Option(
            "--turn-rate",
            metavar="DEG/S",
            help="Turn rate to the left, for motion blur and rolling shutter.",
            rich_help_panel=CAMERA,
        ),
    ] = 0.0
    rays: Annotated[
        Path | None,
        typer.Option("--rays", metavar="FILE", help="Also write the ray of each pixel: .exr."),
    ] = None
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", metavar="FILE", help="Also write camera and pose: .json."),
    ] = None
    up_axis: UpOption = None
    meters_per_unit: UnitOption = None
    resources: ResourcesOption = None
    backend: BackendOption = Backend.CUBE
    device: DeviceOption = None


class ViewKind(StrEnum):
    """Projections of an unwarped view."""

    CYLINDER = "cylinder"
    PERSPECTIVE = "perspective"
    BIRDSEYE = "birdseye"


@dataclass(frozen=True)
class UnwarpRequest:
    """Parameters of `omnisim unwarp`."""

    image: Annotated[
        Path, typer.Argument(metavar="IMAGE", help="An image of omnisim's, or any other.")
    ]
    kind: Annotated[
        ViewKind,
        typer.Option(
            "--to", help="View: a panorama, that of a pinhole camera, a map of the ground."
        ),
    ]
    output: ImageOption
    also: Annotated[
        str | None,
        typer.Option(
            "--also",
            metavar="CHANNELS",
            help="Ground-truth channels of the image to take along, comma-separated, or all.",
            autocompletion=complete_channels,
        ),
    ] = None
    channel_format: ChannelFormatOption = None
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor",
            metavar="FILE",
            help="Sensor file: .toml.",
            show_default="the image's metadata",
        ),
    ] = None
    size_px: Annotated[
        tuple[int, int] | None,
        typer.Option(
            "--size",
            metavar="W H",
            help="Width and height of the view in pixels.",
            show_default="as fine as the image",
        ),
    ] = None
    yaw_deg: Annotated[
        float,
        typer.Option(
            "--yaw", metavar="DEG", help="Heading of the view, counter-clockwise from the front."
        ),
    ] = 0.0
    pitch_deg: Annotated[
        float | None,
        typer.Option(
            "--pitch", metavar="DEG", help="Perspective: tilt downwards.", show_default="0"
        ),
    ] = None
    field_of_view_deg: Annotated[
        float | None,
        typer.Option(
            "--fov", metavar="DEG", help="Perspective: horizontal field of view.", show_default="90"
        ),
    ] = None
    elevation_deg: Annotated[
        tuple[float, float] | None,
        typer.Option(
            "--elevation",
            metavar="LOW HIGH",
            help="Cylinder: lowest and highest row in degrees above the horizon.",
            show_default="-45 to the highest seen",
        ),
    ] = None
    height_m: Annotated[
        float | None,
        typer.Option(
            "--height",
            metavar="M",
            help="Bird's eye: height of the viewpoint over the ground.",
            show_default="the image's z",
        ),
    ] = None
    extent_m: Annotated[
        float | None,
        typer.Option(
            "--extent",
            metavar="M",
            help="Bird's eye: distance from the map's center to its edge.",
            show_default="4 × height",
        ),
    ] = None
    right_at: Annotated[
        float | None,
        typer.Option(
            "--right-at",
            metavar="METERS",
            help="Optics without one viewpoint: distance of the points that are shown right.",
            show_default="infinity",
        ),
    ] = None


class RangeMode(StrEnum):
    """Measuring modes of an LMS200: the unit of its ranges."""

    MM = "mm"
    CM = "cm"


@dataclass(frozen=True)
class ScanRequest:
    """Parameters of `omnisim scan`."""

    scene: SceneArgument
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Ranges: .csv with beam, angle_deg, range_m.",
        ),
    ]
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Also plot the scan from above: .png .pdf .svg.",
        ),
    ] = None
    at: AtOption = None
    yaw_deg: YawOption = None
    pitch_deg: PitchOption = 0.0
    roll_deg: RollOption = 0.0
    time_s: TimeOption = 0.0
    resolution_deg: Annotated[
        float,
        typer.Option(
            "--resolution",
            metavar="DEG",
            help="Angle between two beams: 1 or 0.5 over 180°, or 0.25 over 100°.",
        ),
    ] = 0.5
    mode: Annotated[
        RangeMode,
        typer.Option(
            "--mode", help="Ranges to 8.19 m in steps of 1 mm, or to 81.9 m in steps of 1 cm."
        ),
    ] = RangeMode.MM
    noise: Annotated[
        bool,
        typer.Option("--noise/--no-noise", help="Ranges with the device's errors, or without."),
    ] = True
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", help="Seed of the device's errors.")
    ] = 0
    up_axis: UpOption = None
    meters_per_unit: UnitOption = None
    resources: ResourcesOption = None
    device: DeviceOption = None


@dataclass(frozen=True)
class MirrorRequest:
    """Parameters of `omnisim mirror`."""

    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="Mesh: .glb .obj .ply; profile: .csv."),
    ]
    polygons: Annotated[
        int | None,
        typer.Option(
            "-n",
            "--polygons",
            metavar="POLYGONS",
            help="Polygons of the mesh.",
            show_default="as many as 0.1 px need, or the sensor file's",
        ),
    ] = None
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor",
            metavar="FILE",
            help="Sensor file: .toml.",
            show_default="the paper's mirror",
        ),
    ] = None
    optics: Annotated[
        Path | None,
        typer.Option("--optics", metavar="FILE", help="Optics file instead: .toml."),
    ] = None
    surface: Annotated[
        int,
        typer.Option("--surface", metavar="NUMBER", help="Number of its surface, from 0."),
    ] = 0


@dataclass(frozen=True)
class SensorRequest:
    """Parameters of `omnisim sensor`."""

    check: Annotated[
        Path | None,
        typer.Option(
            "--check",
            metavar="FILE",
            help="Sensor file to check, instead of printing the default one.",
        ),
    ] = None


@dataclass(frozen=True)
class SceneRequest:
    """Parameters of `omnisim scene show`."""

    scene: SceneArgument
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Also plot the scene from above: .png .pdf .svg.",
        ),
    ] = None
    json: Annotated[
        bool, typer.Option("--json", help="Print JSON, with all instances, and nothing else.")
    ] = False
    all: Annotated[
        bool, typer.Option("--all", help="List all instances, not only the largest.")
    ] = False
    labels: LabelsOption = None
    up_axis: UpOption = None
    meters_per_unit: UnitOption = None
    resources: ResourcesOption = None


@dataclass(frozen=True)
class SceneConvertRequest:
    """Parameters of `omnisim scene convert`."""

    scene: SceneArgument
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="File: .glb.")]
    up_axis: UpOption = None
    meters_per_unit: UnitOption = None
    resources: ResourcesOption = None
