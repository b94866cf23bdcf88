"""Requests of the commands that record or read runs, and of the robot commands."""

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
from omnisim.evaluation.estimator_registry import ESTIMATORS


class PhysicsEngine(StrEnum):
    """Physics engines of a drive."""

    MUJOCO = "mujoco"


@dataclass(frozen=True, kw_only=True)
class PathOptions:
    """Motion along a path."""

    panel: ClassVar[str] = TRAJECTORY

    step_m: float = 0.41
    """Maximum step length along waypoints."""
    turn_step_deg: float = 12.0
    """Maximum step angle of a turn."""
    rate_hz: float | None = None
    """Steps per second, in place of --step and --turn-step, or for a file without times."""
    ground_m: Annotated[float | None, Option(default="the scene's floor under the wheels")] = None
    """Height of the waypoints."""
    no_contact: bool = False
    """Reject a path on which the body hits the scene."""
    ignore_limits: bool = False
    """Ignore the robot's kinematic limits."""
    physics: Annotated[
        PhysicsEngine | None,
        Option(metavar="ENGINE", default="none: motion as planned, through obstacles"),
    ] = None
    """Physics engine that simulates wheel slip and collisions: mujoco."""
    axes: Annotated[PoseAxes | None, Option(default="kitti for KITTI's files, else world")] = None
    """Axes of a file's poses: kitti (x right, y down, z ahead) or world (x forward, y left, z
    up)."""


@dataclass(frozen=True, kw_only=True)
class DriveRequest:
    """Parameters of `omnisim drive`."""

    world: SceneOptions
    robots: Annotated[
        list[str],
        Option(
            flags=("--robot",),
            metavar="NAME|FILE",
            complete=completion.complete_robot,
            example="p2at",
        ),
    ]
    """Robot file, built-in name, or model (.sdf .urdf .xml). Several robots, each with its --path,
    drive together; NAME=FILE gives each its own folder."""
    paths: Annotated[
        list[str],
        Option(
            flags=("--path",),
            metavar="NAME|FILE",
            complete=completion.complete_path,
            example="lap",
        ),
    ]
    """Path of the scene, or a file: .tum .kitti .csv, or EuRoC's. A .csv with only x_m and y_m
    holds waypoints."""
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder of the run; an unfinished run resumes."""
    force: bool = False
    """Overwrite an existing run in the folder."""
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
    """Folder of the run."""
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder for the estimate, figures and report."""
    model: Annotated[Path | None, Option(default="learned from the run's own labels")] = None
    """Color model from `omnisim landmarks train`: .npz."""
    params: Annotated[Path | None, Option(default="omnisim's own")] = None
    """Parameters of the filter: .toml."""


@dataclass(frozen=True, kw_only=True)
class PlotRequest(RunSceneOptions):
    """Parameters of `omnisim plot`."""

    run: RunFolder
    """Folder of the run."""
    output: Annotated[Path | None, Option(default="RUN/plot.png")] = None
    """Plot to write: .png .pdf .svg."""


@dataclass(frozen=True, kw_only=True)
class VideoRequest(RunCameraOptions):
    """Parameters of `omnisim video`."""

    run: RunFolder
    """Folder of the run."""
    output: Path
    """Video to write: .mp4 .mkv."""
    rate_hz: Annotated[float, Option(flags=("--fps",))] = 10.0
    """Frames per second."""


@dataclass(frozen=True, kw_only=True)
class ExportRequest:
    """Parameters of `omnisim export`."""

    run: RunFolder
    """Folder of the run."""
    format: Annotated[
        str, Option(flags=("--to",), metavar="FORMAT", names=completion.export_formats)
    ]
    """Format: {names}."""
    output: Annotated[Path, Option(metavar="DIR")]
    """New folder; it appears when it is complete."""
    camera_name: Annotated[
        str | None,
        Option(
            metavar="NAME",
            default="all, or the first for single-camera formats",
            complete=completion.complete_run_camera,
        ),
    ] = None
    """Name of the run's camera."""
    start_time: Annotated[str, Option(metavar="S|DATE")] = "0"
    """Stamp of the run's time 0: seconds since 1970, or a date such as 2026-01-31T12:00:00."""
    compressed: bool = False
    """Write images as PNG where the format allows pixels or PNG: ros2-*."""
    with_points: Annotated[bool, Option(flags=("--points",))] = False
    """Also write point clouds from the cameras' ranges: ros2-*."""


@dataclass(frozen=True, kw_only=True)
class TrainRequest(RunSceneOptions, RunCameraOptions):
    """Parameters of `omnisim landmarks train`."""

    run: RunFolder
    """Folder of the run."""
    output: Path
    """Color model to write: .npz."""
    missed: Annotated[float, Option(metavar="COST")] = 1.0
    """Cost of a false negative: a missed pixel of a landmark."""
    false_alarm: Annotated[float, Option(metavar="COST")] = 4.0
    """Cost of a false positive: a detected pixel of anything else."""


@dataclass(frozen=True, kw_only=True)
class DetectRequest(RunSceneOptions, RunCameraOptions):
    """Parameters of `omnisim landmarks detect`."""

    source: Annotated[Path, Argument(metavar="IMAGE|RUN")]
    """Image by omnisim, or folder of a run."""
    model: Path
    """Color model from `omnisim landmarks train`: .npz."""
    output: Path | None = None
    """Detections to write: .csv."""
    show: Path | None = None
    """Also draw annotated panoramas: .png .pdf .svg."""
    height_m: Annotated[float | None, Option(default="the image's z")] = None
    """Height of an image's viewpoint above the ground."""
    sensor: Path | None = None
    """Sensor file for an image without metadata: .toml."""


@dataclass(frozen=True, kw_only=True)
class CheckRequest:
    """Parameters of `omnisim robot check` and `omnisim robot show`."""

    robot: Annotated[
        str, Argument(metavar="FILE", complete=completion.complete_robot, example="p2at")
    ]
    """Robot file, folder with a robot.toml, or built-in name."""


@dataclass(frozen=True, kw_only=True)
class ImportRequest:
    """Parameters of `omnisim robot import`."""

    configuration: Annotated[Path, Argument(metavar="FILE")]
    """Configuration of USARSim (USARBot.ini), or a model: .sdf .urdf .xml."""
    output: Path
    """Robot file to write: .toml."""
    robot_class: Annotated[
        str | None, Option(flags=("--class",), metavar="NAME", default="the only one in the file")
    ] = None
    """Class of the robot, such as P2AT, or name of the model."""
    unreal_units: Annotated[bool, Option(default="meters, z down, radians")] = False
    """Read the file in Unreal units: 250 per meter, z up, 65536 per turn."""
    origin_height_m: Annotated[float | None, Option(default="0")] = None
    """Height of USARSim's origin of the robot above the ground."""
    resources: Resources = None
    """Folder of models that the file references by URI, such as model://chair; can be repeated."""


@dataclass(frozen=True, kw_only=True)
class EvaluateRequest:
    """Parameters of `omnisim evaluate`."""

    run: Annotated[Path, Argument(metavar="RUN|PLAN")]
    """Folder of a finished run, file of a sweep's plan (.toml), or name of a built-in plan."""
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder of the report and the trajectories; existing results in it are kept."""
    estimators: Annotated[
        list[str] | None,
        Option(flags=("--with",), metavar="NAMES", default="all", names=lambda: ESTIMATORS),
    ] = None
    """Estimators, comma-separated: {names}; or command:… with {run} and {out}; repeatable. Not with
    a plan."""
    limit_s: Annotated[float, Option(min=1.0, max=86400.0)] = 600.0
    """Time limit of each estimator of a run; plans have `limit_s`."""
    processes: Annotated[int, Option(min=1, max=256)] = 1
    """Number of concurrent drives of a plan."""
    engine: Annotated[str, Option(metavar="NAME", names=lambda: ("local", "ray"))] = "local"
    """Engine that distributes the drives of a plan: {names}."""
    address: Annotated[
        str | None, Option(metavar="ADDRESS", default="a cluster on this machine")
    ] = None
    """Address of the Ray cluster."""
