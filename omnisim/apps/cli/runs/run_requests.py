"""Parameters of the commands that record a run, or read one."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import (
    TRAJECTORY,
    AlsoOption,
    AxesOption,
    Backend,
    BackendOption,
    BakedOption,
    Boxes3dOption,
    ChannelFormatOption,
    DeviceOption,
    ForceOption,
    LabelsOption,
    NoShadowsOption,
    PolygonsOption,
    PresetOption,
    QualityOption,
    ResourcesOption,
    RunArgument,
    RunCameraOption,
    RunSceneOption,
    SceneArgument,
    SizeOption,
    SkyOption,
    UnitOption,
    UnlitOption,
    UpOption,
)
from omnisim.apps.cli.completion import (
    EXPORT_FORMATS,
    complete_path,
    complete_robot,
    complete_run_camera,
    one_of,
)


class PhysicsEngine(StrEnum):
    """Physics engines of a drive."""

    MUJOCO = "mujoco"


@dataclass(frozen=True)
class DriveRequest:
    """Parameters of `omnisim drive`."""

    scene: SceneArgument
    robots: Annotated[
        list[str],
        typer.Option(
            "--robot",
            metavar="NAME|FILE",
            autocompletion=complete_robot,
            help="Robot file, built-in name, or model: .sdf .urdf .xml. Several, each with its "
            "--path, drive together: NAME=FILE gives each a folder of its own.",
        ),
    ]
    paths: Annotated[
        list[str],
        typer.Option(
            "--path",
            metavar="NAME|FILE",
            autocompletion=complete_path,
            help="Path of the scene, or a file: .tum .kitti .csv, or EuRoC's; a .csv of x_m and "
            "y_m alone has waypoints.",
        ),
    ]
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder of the run; an unfinished run resumes."
        ),
    ]
    seed: Annotated[
        int,
        typer.Option("--seed", metavar="N", help="Seed of the odometry's and the cameras' noise."),
    ] = 0
    step_m: Annotated[
        float,
        typer.Option(
            "--step", metavar="M", help="Longest step along waypoints.", rich_help_panel=TRAJECTORY
        ),
    ] = 0.41
    turn_step_deg: Annotated[
        float,
        typer.Option(
            "--turn-step", metavar="DEG", help="Largest step of a turn.", rich_help_panel=TRAJECTORY
        ),
    ] = 12.0
    rate_hz: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Steps per second, instead of --step and --turn-step, or of a file without times.",
            rich_help_panel=TRAJECTORY,
        ),
    ] = None
    ground_m: Annotated[
        float | None,
        typer.Option(
            "--ground",
            metavar="M",
            help="Height of waypoints.",
            show_default="the scene's floor under the wheels",
            rich_help_panel=TRAJECTORY,
        ),
    ] = None
    no_contact: Annotated[
        bool,
        typer.Option(
            "--no-contact",
            help="Refuse a path on which the body hits the scene.",
            rich_help_panel=TRAJECTORY,
        ),
    ] = False
    ignore_limits: Annotated[
        bool,
        typer.Option(
            "--ignore-limits",
            help="Ignore the robot's kinematic limits.",
            rich_help_panel=TRAJECTORY,
        ),
    ] = False
    physics: Annotated[
        PhysicsEngine | None,
        typer.Option(
            "--physics",
            metavar="ENGINE",
            help="Engine in which wheels slip and things collide: mujoco.",
            show_default="the robot drives as planned, through everything",
            rich_help_panel=TRAJECTORY,
        ),
    ] = None
    axes: AxesOption = None
    polygons: PolygonsOption = None
    size_px: SizeOption = None
    quality: QualityOption = None
    unlit: UnlitOption = False
    no_shadows: NoShadowsOption = False
    sky: SkyOption = None
    baked: BakedOption = None
    also: AlsoOption = None
    channel_format: ChannelFormatOption = None
    boxes_3d: Boxes3dOption = False
    labels: LabelsOption = None
    force: ForceOption = False
    preset: PresetOption = None
    up_axis: UpOption = None
    meters_per_unit: UnitOption = None
    resources: ResourcesOption = None
    backend: BackendOption = Backend.CUBE
    device: DeviceOption = None


@dataclass(frozen=True)
class LocalizeRequest:
    """Parameters of `omnisim localize`."""

    run: RunArgument
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder for the estimate, figures and report."
        ),
    ]
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            metavar="FILE",
            help="Color model of `omnisim landmarks train`: .npz.",
            show_default="learned from the run's own labels",
        ),
    ] = None
    params: Annotated[
        Path | None,
        typer.Option(
            "--params",
            metavar="FILE",
            help="Parameters of the filter: .toml.",
            show_default="omnisim's own",
        ),
    ] = None
    scene: RunSceneOption = None
    camera_name: RunCameraOption = None


@dataclass(frozen=True)
class PlotRequest:
    """Parameters of `omnisim plot`."""

    run: RunArgument
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Plot: .png .pdf .svg.",
            show_default="RUN/plot.png",
        ),
    ] = None
    scene: RunSceneOption = None


@dataclass(frozen=True)
class VideoRequest:
    """Parameters of `omnisim video`."""

    run: RunArgument
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="Video: .mp4 .mkv."),
    ]
    camera_name: RunCameraOption = None
    rate_hz: Annotated[float, typer.Option("--fps", metavar="HZ", help="Frames per second.")] = 10.0


@dataclass(frozen=True)
class ExportRequest:
    """Parameters of `omnisim export`."""

    run: RunArgument
    format: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="FORMAT",
            autocompletion=one_of(*EXPORT_FORMATS),
            help=f"Format: {', '.join(EXPORT_FORMATS)}.",
        ),
    ]
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", help="New folder; it appears when it is whole."
        ),
    ]
    camera_name: Annotated[
        str | None,
        typer.Option(
            "--camera-name",
            metavar="NAME",
            autocompletion=complete_run_camera,
            help="Camera of the run.",
            show_default="all; the first in formats of one camera",
        ),
    ] = None
    start_time: Annotated[
        str,
        typer.Option(
            "--start-time",
            metavar="S|DATE",
            help="Stamp of the run's time 0: seconds since 1970, or a date such as "
            "2026-01-31T12:00:00.",
        ),
    ] = "0"
    compressed: Annotated[
        bool,
        typer.Option(
            "--compressed", help="Images as PNG, where a format has pixels or PNG: ros2-*."
        ),
    ] = False
    with_points: Annotated[
        bool,
        typer.Option("--points", help="Also point clouds of the cameras' ranges: ros2-*."),
    ] = False


@dataclass(frozen=True)
class TrainRequest:
    """Parameters of `omnisim landmarks train`."""

    run: RunArgument
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="Color model: .npz."),
    ]
    missed: Annotated[
        float,
        typer.Option(
            "--missed", metavar="COST", help="Cost of a false negative: a landmark's pixel missed."
        ),
    ] = 1.0
    false_alarm: Annotated[
        float,
        typer.Option(
            "--false-alarm", metavar="COST", help="Cost of a false positive: another pixel taken."
        ),
    ] = 4.0
    scene: RunSceneOption = None
    camera_name: RunCameraOption = None


@dataclass(frozen=True)
class DetectRequest:
    """Parameters of `omnisim landmarks detect`."""

    source: Annotated[
        Path, typer.Argument(metavar="IMAGE|RUN", help="An image of omnisim's, or a run.")
    ]
    model: Annotated[
        Path,
        typer.Option(
            "--model", metavar="FILE", help="Color model of `omnisim landmarks train`: .npz."
        ),
    ]
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Detections: .csv."),
    ] = None
    show: Annotated[
        Path | None,
        typer.Option(
            "--show",
            metavar="FILE",
            help="Also draw annotated panoramas: .png .pdf .svg.",
        ),
    ] = None
    height_m: Annotated[
        float | None,
        typer.Option(
            "--height",
            metavar="M",
            help="Height of an image's viewpoint over the ground.",
            show_default="the image's z",
        ),
    ] = None
    scene: RunSceneOption = None
    camera_name: RunCameraOption = None
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor",
            metavar="FILE",
            help="Sensor file of an image without metadata: .toml.",
        ),
    ] = None
