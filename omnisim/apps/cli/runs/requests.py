"""Requests of the commands that record a run, or read one, and of those on robots."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, ClassVar

from omnisim.apps.cli import completion
from omnisim.apps.cli.option_groups import (
    TRAJECTORY,
    BackendOptions,
    MeshImageOptions,
    PoseAxes,
    Resources,
    RunCameraOptions,
    RunFolder,
    RunSceneOptions,
    SceneOptions,
    ShadowedLightOptions,
    TruthOptions,
)
from omnisim.apps.cli.options import Argument, Option


class PhysicsEngine(StrEnum):
    """Physics engines of a drive."""

    MUJOCO = "mujoco"


@dataclass(frozen=True, kw_only=True)
class PathOptions:
    """Way along a path."""

    panel: ClassVar[str] = TRAJECTORY

    step_m: float = 0.41
    """Longest step along waypoints."""
    turn_step_deg: float = 12.0
    """Largest step of a turn."""
    rate_hz: float | None = None
    """Steps per second, instead of --step and --turn-step, or of a file without times."""
    ground_m: Annotated[float | None, Option(default="the scene's floor under the wheels")] = None
    """Height of waypoints."""
    no_contact: bool = False
    """Refuse a path on which the body hits the scene."""
    ignore_limits: bool = False
    """Ignore the robot's kinematic limits."""
    physics: Annotated[
        PhysicsEngine | None,
        Option(metavar="ENGINE", default="the robot drives as planned, through everything"),
    ] = None
    """Engine in which wheels slip and objects collide: mujoco."""
    axes: Annotated[PoseAxes | None, Option(default="kitti for KITTI's files, else world")] = None
    """Axes of a file's poses: kitti (x right, y down, z ahead) or world (x forward, y left, z
    up)."""


@dataclass(frozen=True, kw_only=True)
class DriveRequest:
    """Parameters of `omnisim drive`."""

    world: SceneOptions
    robots: Annotated[
        list[str],
        Option(flags=("--robot",), metavar="NAME|FILE", complete=completion.complete_robot),
    ]
    """Robot file, built-in name, or model: .sdf .urdf .xml. Several, each with its --path, drive
    together: NAME=FILE gives each a folder of its own."""
    paths: Annotated[
        list[str],
        Option(flags=("--path",), metavar="NAME|FILE", complete=completion.complete_path),
    ]
    """Path of the scene, or a file: .tum .kitti .csv, or EuRoC's; a .csv of x_m and y_m alone has
    waypoints."""
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder of the run; an unfinished run resumes."""
    force: bool = False
    """Overwrite another run in the folder."""
    seed: int = 0
    """Seed of the odometry's and the cameras' noise."""
    light: ShadowedLightOptions
    way: PathOptions
    image: MeshImageOptions
    truth: TruthOptions
    gpu: BackendOptions


@dataclass(frozen=True, kw_only=True)
class LocalizeRequest(RunSceneOptions, RunCameraOptions):
    """Parameters of `omnisim localize`."""

    run: RunFolder
    """Folder of a run."""
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder for the estimate, figures and report."""
    model: Annotated[Path | None, Option(default="learned from the run's own labels")] = None
    """Color model of `omnisim landmarks train`: .npz."""
    params: Annotated[Path | None, Option(default="omnisim's own")] = None
    """Parameters of the filter: .toml."""


@dataclass(frozen=True, kw_only=True)
class PlotRequest(RunSceneOptions):
    """Parameters of `omnisim plot`."""

    run: RunFolder
    """Folder of a run."""
    output: Annotated[Path | None, Option(default="RUN/plot.png")] = None
    """Plot: .png .pdf .svg."""


@dataclass(frozen=True, kw_only=True)
class VideoRequest(RunCameraOptions):
    """Parameters of `omnisim video`."""

    run: RunFolder
    """Folder of a run."""
    output: Path
    """Video: .mp4 .mkv."""
    rate_hz: Annotated[float, Option(flags=("--fps",))] = 10.0
    """Frames per second."""


@dataclass(frozen=True, kw_only=True)
class ExportRequest:
    """Parameters of `omnisim export`."""

    run: RunFolder
    """Folder of a run."""
    format: Annotated[
        str, Option(flags=("--to",), metavar="FORMAT", names=completion.export_formats)
    ]
    """Format: {names}."""
    output: Annotated[Path, Option(metavar="DIR")]
    """New folder; it appears once it is complete."""
    camera_name: Annotated[
        str | None,
        Option(
            metavar="NAME",
            default="all; the first in formats of one camera",
            complete=completion.complete_run_camera,
        ),
    ] = None
    """Camera of the run."""
    start_time: Annotated[str, Option(metavar="S|DATE")] = "0"
    """Stamp of the run's time 0: seconds since 1970, or a date such as 2026-01-31T12:00:00."""
    compressed: bool = False
    """Images as PNG, where a format has pixels or PNG: ros2-*."""
    with_points: Annotated[bool, Option(flags=("--points",))] = False
    """Also point clouds of the cameras' ranges: ros2-*."""


@dataclass(frozen=True, kw_only=True)
class TrainRequest(RunSceneOptions, RunCameraOptions):
    """Parameters of `omnisim landmarks train`."""

    run: RunFolder
    """Folder of a run."""
    output: Path
    """Color model: .npz."""
    missed: Annotated[float, Option(metavar="COST")] = 1.0
    """Cost of a false negative: a landmark's pixel missed."""
    false_alarm: Annotated[float, Option(metavar="COST")] = 4.0
    """Cost of a false positive: another pixel detected."""


@dataclass(frozen=True, kw_only=True)
class DetectRequest(RunSceneOptions, RunCameraOptions):
    """Parameters of `omnisim landmarks detect`."""

    source: Annotated[Path, Argument(metavar="IMAGE|RUN")]
    """An image of omnisim's, or a run."""
    model: Path
    """Color model of `omnisim landmarks train`: .npz."""
    output: Path | None = None
    """Detections: .csv."""
    show: Path | None = None
    """Also draw annotated panoramas: .png .pdf .svg."""
    height_m: Annotated[float | None, Option(default="the image's z")] = None
    """Height of an image's viewpoint above the ground."""
    sensor: Path | None = None
    """Sensor file of an image without metadata: .toml."""


@dataclass(frozen=True, kw_only=True)
class CheckRequest:
    """Parameters of `omnisim robot check`."""

    robot: Annotated[str, Argument(metavar="FILE", complete=completion.complete_robot)]
    """Robot file, folder with a robot.toml, or built-in name."""


@dataclass(frozen=True, kw_only=True)
class ImportRequest:
    """Parameters of `omnisim robot import`."""

    configuration: Annotated[Path, Argument(metavar="FILE")]
    """Configuration of USARSim (USARBot.ini), or a model: .sdf .urdf .xml."""
    output: Path
    """Robot file: .toml."""
    robot_class: Annotated[
        str | None, Option(flags=("--class",), metavar="NAME", default="the file's only one")
    ] = None
    """Class of the robot, such as P2AT, or name of the model."""
    unreal_units: Annotated[bool, Option(default="meters, z down, radians")] = False
    """Read the file in Unreal units: 250 to a meter, z up, 65536 to a turn."""
    origin_height_m: Annotated[float | None, Option(default="0")] = None
    """Height of USARSim's origin of the robot above the ground."""
    resources: Resources = None
    """Folder of models that the file names by URI, such as model://chair; can be repeated."""
