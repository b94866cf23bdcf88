"""Requests of the commands that record or read runs, and of the robot commands."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal, get_args

from omnisim.apps.cli import completion
from omnisim.apps.cli import option_groups as groups
from omnisim.apps.cli.options import OWN, Argument, Option, command, of, options
from omnisim.datasets.export.ros2 import CloudLayout
from omnisim.evaluation.estimator_registry import ESTIMATORS

_FORMATS = completion.names_of("datasets.export.export_formats.FORMATS")
_COSTS = "perception.landmarks.color_model.Costs"


@options
class PathOptions:
    """Motion along a path."""

    panel: ClassVar[str] = groups.TRAJECTORY

    step_m: float = 0.41
    """Maximum step length along waypoints."""
    turn_step_deg: float = 12.0
    """Maximum turn per step."""
    rate_hz: float | None = None
    """Steps per second, in place of --step and --turn-step, or for a file without times."""
    ground_m: float | None = None
    """Height of the waypoints. Default: the scene's floor under the wheels."""
    no_contact: bool = False
    """Reject a path on which the body hits the scene."""
    ignore_limits: bool = False
    """Ignore the robot's kinematic limits."""
    physics: Annotated[Literal["mujoco"] | None, Option(metavar="ENGINE")] = None
    """Physics engine that simulates wheel slip and collisions: mujoco. Default: none (motion as
    planned, through obstacles)."""
    axes: groups.Axes = None


@command(
    "drive", "runs.drive.drive",
    first="robots paths output size_px quality also rate_hz physics seed force",
)  # fmt: skip
class DriveRequest:
    """Drive a robot along a path and record images, scans, odometry and ground truth.

    omnisim drive soccer --robot p2at --path lap -o run
    omnisim drive soccer --robot superscout --path lap --size 120 --also range -o run
    """

    world: groups.SceneOptions
    robots: Annotated[
        list[str],
        Option(flags=("--robot",), metavar="NAME|FILE", complete=completion.complete_robot,
               example="p2at"),
    ]  # fmt: skip
    """Robot file, built-in name, or model (.sdf .urdf .xml). Several robots, each with its --path,
    drive together; NAME=FILE gives each its own folder."""
    paths: Annotated[
        list[str],
        Option(flags=("--path",), metavar="NAME|FILE", complete=completion.complete_path,
               example="lap"),
    ]  # fmt: skip
    """Path of the scene, or a file: .tum .kitti .csv, or EuRoC's. A .csv with only x_m and y_m
    holds waypoints; one with speed_mps and turn_rate_radps, commands as omnisim serve writes them.
    """
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder of the run; an unfinished run resumes."""
    force: bool = False
    """Overwrite an existing run in the folder."""
    seed: int = 0
    """Seed of the odometry's and the cameras' noise."""
    light: groups.ShadowedLightOptions
    way: PathOptions
    image: groups.MeshImageOptions
    truth: groups.TruthOptions
    gpu: groups.BackendOptions


@options
class ClockOptions:
    """Simulated time, and where the robots begin."""

    panel: ClassVar[str] = groups.TRAJECTORY

    fast: bool = False
    """Simulate as fast as possible, and make every measurement, instead of following the wall
    clock."""
    lockstep: bool = False
    """Let only the clients' steps advance the time: repeatable to the byte."""
    duration_s: Annotated[float | None, Option(ge=0.01, le=1e7)] = None
    """Simulated time at which to end. Default: Ctrl-C ends it."""
    rate_hz: Annotated[float, Option(ge=0.1, le=100)] = 10.0
    """Rate of odometry and transforms, and of sensors without their own rate."""
    timeout_s: Annotated[float, Option(ge=0.02, le=1e6)] = 0.5
    """Duration of a velocity command: without another one the robot stops."""
    at: Annotated[tuple[float, float] | None, Option(metavar="X Y")] = None
    """Position of the first robot at the start. Default: the scene's start."""
    yaw_deg: float | None = None
    """Heading of the first robot at the start. Default: the scene's start."""


@options
class StreamOptions:
    """Protocols of the streams, and files to record."""

    panel: ClassVar[str] = "Streams"

    protocols: Annotated[
        str, Option(metavar="PROTOCOLS", names=lambda: ("foxglove", "plain", "ros2"))
    ] = "foxglove,plain"
    """Protocols, comma-separated: {names}. foxglove is Foxglove's and Lichtblick's, plain a page
    for your browser and a WebSocket for any program, ros2 is for ROS 2 nodes with rmw_zenoh_cpp."""
    host: Annotated[str, Option(metavar="ADDRESS")] = "localhost"
    """Address to listen on; clients need a token unless it is localhost."""
    port: Annotated[int, Option(ge=0, le=65534)] = 8765
    """Port of the first protocol; the next has the next port. 0: any free ports."""
    router: Annotated[str | None, Option(metavar="ENDPOINT", example="tcp/127.0.0.1:7447")] = None
    """Zenoh's router for ros2, which listens there if none does. Default: tcp/127.0.0.1:7447."""
    cloud_layout: Literal["generic", "velodyne", "ouster", "ouster-u8", "livox", "livox-custom"] = (
        "generic"
    )
    """Layout of lidar clouds, as the drivers of these devices publish it."""
    record: Path | None = None
    """Also record all topics: .mcap."""
    commands: Annotated[Path | None, Option(metavar="FILE")] = None
    """Also write the commands that the first robot received: .csv, a path for `omnisim drive`."""


@command(
    "serve", "runs.serve.run",
    first="scene protocols port fast lockstep record size_px quality also",
)  # fmt: skip
class ServeRequest:
    """Serve simulated robots to your stack: sensors out, velocity commands in.

    omnisim serve p2at --scene soccer
    omnisim serve run --record run.mcap
    """

    sources: Annotated[list[str], Argument(metavar="ROBOT|RUN", complete=completion.complete_robot)]
    """Robot file, built-in name, or model (.sdf .urdf .xml); several robots share the world, as
    NAME=FILE if they are alike. Or the folder of a run, to play it back."""
    scene: Annotated[str | None, Option(metavar="SCENE", complete=completion.complete_scene)] = None
    """Scene file, or name of a built-in scene. Default: soccer."""
    seed: int = 0
    """Seed of the odometry's and the cameras' noise."""
    files: groups.FileUnitOptions
    clock: ClockOptions
    streams: StreamOptions
    light: groups.ShadowedLightOptions
    image: groups.MeshImageOptions
    also: Annotated[
        str | None,
        Option(metavar="CHANNELS", names=lambda: ("range", "semantic", "instance")),
    ] = None
    """Ground-truth channels that cameras also publish, comma-separated: {names}."""
    gpu: groups.BackendOptions


@options
class PoseOptions:
    """Poses of a rig, and their place in the scene."""

    panel: ClassVar[str] = groups.TRAJECTORY

    trajectory: Path
    """Poses: TUM, KITTI, EuRoC, .csv, or nerfstudio's transforms.json, which also sets the
    camera."""
    trajectory_frame: Annotated[str | None, Option(metavar="body|camera|NAME")] = None
    """Frame that the poses describe: the rig's body, its first camera, or a named camera. Default:
    by the file's format, with a note."""
    axes: groups.Axes = None
    rate_hz: float | None = None
    """Poses per second of a trajectory without times. Default: 1, with a note."""
    at: groups.Position = None
    """Position of the file's origin in the scene, in meters, z up. Default: 0 0 0."""
    yaw_deg: float | None = None
    """Heading of the file's origin, counter-clockwise from +x. Default: 0."""
    pitch_deg: float = 0.0
    """Pitch of the file's origin, positive with the front down."""
    roll_deg: float = 0.0
    """Roll of the file's origin, positive with the right side down."""


@options
class RigOptions(groups.CameraFileOptions):
    """Cameras along a trajectory."""

    camera_name: Annotated[str | None, Option(metavar="NAME|all")] = None
    """Name of the camera in the calibration file. Default: all."""
    robot: groups.RobotName = None
    """Robot whose body is in the images, and whose sensors all record, including IMUs and
    lidars."""


@command(
    "record", "runs.drive.record",
    elsewhere={"--overlay": "a run keeps the labels, --also instance,semantic; omnisim render"},
    first="output trajectory calibration_file robot rate_hz size_px quality preset also force",
)  # fmt: skip
class RecordRequest:
    """Record a camera or a rig along the poses of a trajectory, as a run.

    omnisim record courtyard --trajectory poses.tum --camera stereo.yaml -o stereo
    omnisim record soccer --trajectory poses.tum --sensor sensor.toml --also range -o run
    """

    output: Annotated[Path, Option(metavar="DIR")]
    """Folder of the run; an unfinished run resumes."""
    force: bool = False
    """Overwrite an existing run in the folder."""
    seed: int = 0
    """Seed of the cameras' noise."""
    world: groups.SceneOptions
    poses: PoseOptions
    light: groups.ShadowedLightOptions
    camera: RigOptions
    image: groups.MeshImageOptions
    truth: groups.TruthOptions
    gpu: groups.BackendOptions


@command("localize", "runs.landmarks.localize", extra="reports")
class LocalizeRequest(groups.RunSceneOptions, groups.RunCameraOptions):
    """Localize the robot of a run from its odometry and the landmarks in its images.

    omnisim localize run -o localized
    omnisim localize run --model colors.npz -o localized
    """

    run: groups.RunFolder
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder for the estimate, figures and report."""
    model: Path | None = None
    """Color model from `omnisim landmarks train`: .npz. Default: learned from the run's own
    labels."""
    params: Path | None = None
    """Parameters of the filter: .toml. Default: omnisim's own."""


@command("plot", "runs.plot.plot", extra="plots")
class PlotRequest(groups.RunSceneOptions):
    """Plot a run from above: map, path, odometry, landmarks, images.

    omnisim plot run
    omnisim plot run -o map.pdf
    """

    run: groups.RunFolder
    output: Path | None = None
    """Plot to write: .png .pdf .svg. Default: RUN/plot.png."""


@command("video", "runs.plot.video", extra="video")
class VideoRequest(groups.RunCameraOptions):
    """Encode the images of a run as a video.

    omnisim video run -o run.mp4
    omnisim video run --camera-name front --fps 25 -o front.mp4
    """

    run: groups.RunFolder
    output: Path
    """Video to write: .mp4 .mkv."""
    rate_hz: Annotated[float, Option(flags=("--fps",), ge=0.1, le=240)] = 10.0
    """Frames per second."""


@command("export", "runs.export.run")
class ExportRequest:
    """Export a run for other tools: ROS 2 bags, data sets, structure from motion.

    omnisim export run --to ros2-mcap -o bag
    omnisim export run --to colmap -o colmap
    """

    run: groups.RunFolder
    format: Annotated[str, Option(flags=("--to",), metavar="FORMAT", names=_FORMATS)]
    """Format: {names}."""
    output: Annotated[Path, Option(metavar="DIR")]
    """New folder; it appears when it is complete."""
    camera_name: Annotated[
        str | None, Option(metavar="NAME", complete=completion.complete_run_camera)
    ] = None
    """Name of the run's camera. Default: all, or the first for single-camera formats."""
    start_time: Annotated[str, Option(metavar="S|DATE")] = "0"
    """Time stamp of the run's start: seconds since 1970, or a date such as 2026-01-31T12:00:00."""
    compressed: bool = False
    """Write images as PNG instead of raw pixels: ros2-*."""
    with_points: Annotated[bool, Option(flags=("--points",))] = False
    """Also write point clouds from the cameras' ranges: ros2-*."""
    cloud_layout: Annotated[
        CloudLayout, Option(metavar="LAYOUT", names=lambda: get_args(CloudLayout))
    ] = "generic"
    """Fields of lidar clouds, as the driver of that name publishes them: ros2-*. Layouts:
    {names}."""
    without_map: Annotated[bool, Option(flags=("--no-map",))] = False
    """Leave `map` out of /tf, for SLAM nodes, which publish it themselves: ros2-*."""


@command("landmarks train", "runs.landmarks.train")
class TrainRequest(groups.RunSceneOptions, groups.RunCameraOptions):
    """Learn the colors of landmarks from a run recorded with --also instance.

    omnisim landmarks train run -o colors.npz
    omnisim landmarks train run --false-alarm 10 -o colors.npz
    """

    run: groups.RunFolder
    output: Path
    """Color model to write: .npz."""
    missed: Annotated[float, of(_COSTS, metavar="COST")] = OWN
    false_alarm: Annotated[float, of(_COSTS, metavar="COST")] = OWN


@command("landmarks detect", "runs.landmarks.detect")
class DetectRequest(groups.RunSceneOptions, groups.RunCameraOptions):
    """Detect landmarks with range and bearing in an image, or in all images of a run.

    omnisim landmarks detect run --model colors.npz -o landmarks.csv
    omnisim landmarks detect soccer.png --model colors.npz --show landmarks.png
    """

    source: Annotated[Path, Argument(metavar="IMAGE|RUN")]
    """Image by omnisim, or folder of a run."""
    model: Path
    """Color model from `omnisim landmarks train`: .npz."""
    output: Path | None = None
    """Detections to write: .csv."""
    show: Path | None = None
    """Also draw annotated panoramas: .png .pdf .svg."""
    height_m: float | None = None
    """Height of an image's viewpoint above the ground. Default: the image's z."""
    sensor: Path | None = None
    """Sensor file for an image without metadata: .toml."""


@command("robot list", "runs.robot.list_robots")
class ListRobotsRequest:
    """List the built-in robots.

    omnisim robot list
    """


@command("robot show", "runs.robot.show_robot")
class ShowRobotRequest:
    """Print a whole robot file, with inherited keys and absolute paths, to save and edit.

    omnisim robot show p2at
    omnisim robot show superscout > robot.toml
    """

    robot: Annotated[
        str, Argument(metavar="FILE", complete=completion.complete_robot, example="p2at")
    ]
    """Robot file, folder with a robot.toml, or built-in name."""


@command("robot check", "runs.robot.check_robot")
class CheckRobotRequest(ShowRobotRequest):
    """Check a robot file with its body and sensors, and summarize it.

    omnisim robot check p2at
    omnisim robot check robot.toml
    """


@command("robot import", "runs.robot.import_robot")
class ImportRequest:
    """Convert a robot of USARSim, Gazebo, URDF or MuJoCo to a robot file.

    omnisim robot import model.sdf -o robot.toml
    omnisim robot import USARBot.ini --class P2AT --unreal-units -o p2at.toml
    """

    configuration: Annotated[Path, Argument(metavar="FILE")]
    """Configuration of USARSim (USARBot.ini), or a model: .sdf .urdf .xml."""
    output: Path
    """Robot file to write: .toml."""
    robot_class: Annotated[str | None, Option(flags=("--class",), metavar="NAME")] = None
    """Class of the robot, such as P2AT, or name of the model. Default: the only one in the file."""
    unreal_units: bool = False
    """Read the file in Unreal units: 250 per meter, z up, 65536 per turn. Default: meters, z down,
    radians."""
    origin_height_m: float | None = None
    """Height of USARSim's origin of the robot above the ground. Default: 0."""
    resources: groups.Resources = None


@command("evaluate", "runs.evaluate.run")
class EvaluateRequest(groups.EngineOptions):
    """Apply odometry and SLAM methods to a run, and report their errors; exits with 1 if all fail.

    omnisim evaluate run -o report
    omnisim evaluate run --with wheels,kiss-icp -o report
    """

    run: Annotated[Path, Argument(metavar="RUN|PLAN")]
    """Folder of a finished run, file of a sweep's plan (.toml), or name of a built-in plan."""
    output: Annotated[Path, Option(metavar="DIR")]
    """Folder of the report and the trajectories; existing results in it are kept."""
    estimators: Annotated[
        list[str] | None, Option(flags=("--with",), metavar="NAMES", names=lambda: ESTIMATORS)
    ] = None
    """Estimators, comma-separated: {names}; or command:… with {run} and {out}; repeatable. Not with
    a plan. Default: all."""
    limit_s: Annotated[float, Option(ge=1.0, le=86400.0)] = 600.0
    """Time limit of each estimator of a run; plans have `limit_s`."""
    processes: Annotated[int, Option(ge=1, le=256)] = 1
    """Number of concurrent drives of a plan."""
