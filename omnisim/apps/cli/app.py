"""The command line: parses, calls, prints.

Commands import their modules when they run: `omnisim --help` needs none of them. They raise
OmnisimError for whatever a user can put right.
"""

import errno
import os
import sys
from typing import Annotated, NoReturn

import typer

from omnisim.apps.cli import INTERRUPTED
from omnisim.apps.cli.cameras.calibration_requests import ConvertRequest, ShowRequest
from omnisim.apps.cli.cameras.optics_requests import (
    OpticsCalibrateRequest,
    OpticsCheckRequest,
    OpticsDesignRequest,
    OpticsPlotRequest,
    OpticsProfileRequest,
    OpticsRaysRequest,
)
from omnisim.apps.cli.checks.validation_requests import ExperimentsRequest, ValidateRequest
from omnisim.apps.cli.command import Command, DefaultGroup, Group, command
from omnisim.apps.cli.console import err, out
from omnisim.apps.cli.datasets.dataset_requests import (
    DatasetCheckRequest,
    DatasetConvertRequest,
    DatasetInfoRequest,
    DatasetViewRequest,
    GenerateRequest,
)
from omnisim.apps.cli.images.image_requests import (
    MirrorRequest,
    RenderRequest,
    ScanRequest,
    SceneConvertRequest,
    SceneRequest,
    SensorRequest,
    UnwarpRequest,
)
from omnisim.apps.cli.images.live_requests import LiveRequest
from omnisim.apps.cli.runs.robot_requests import CheckRequest, ImportRequest
from omnisim.apps.cli.runs.run_requests import (
    DetectRequest,
    DriveRequest,
    ExportRequest,
    LocalizeRequest,
    PlotRequest,
    TrainRequest,
    VideoRequest,
)
from omnisim.apps.cli.worlds.bake_requests import BakeRequest
from omnisim.core.errors import OmnisimError
from omnisim.core.extras import require_extra
from omnisim.core.version import __version__

app = typer.Typer(
    name="omnisim",
    cls=Group,
    help="Simulator of omnidirectional cameras, accurate to a tenth of a pixel.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
scene_app = typer.Typer(
    name="scene",
    cls=DefaultGroup,
    help="What is in a scene: `omnisim scene SCENE`; and its conversion to GLB.",
    no_args_is_help=True,
)
robot_app = typer.Typer(
    name="robot",
    cls=Group,
    help="Robots: list, check, or import from USARSim, Gazebo, URDF or MuJoCo.",
    no_args_is_help=True,
)
landmarks_app = typer.Typer(
    name="landmarks",
    cls=Group,
    help="Learn the colors of landmarks, and detect them.",
    no_args_is_help=True,
)
calibration_app = typer.Typer(
    name="calibration",
    cls=Group,
    help="Calibration files of other tools: convert, show, list the formats.",
    no_args_is_help=True,
)
optics_app = typer.Typer(
    name="optics",
    cls=Group,
    help="Optical systems without one viewpoint: check, plot, design.",
    no_args_is_help=True,
)


dataset_app = typer.Typer(
    name="dataset",
    cls=Group,
    help="Data sets: show, check the hashes, look at samples, convert.",
    no_args_is_help=True,
)


@app.command(cls=Command)
def info() -> None:
    """Show versions, built-in scenes, and the GPUs that can render."""
    from omnisim.apps.cli.info import run

    run()


@command(scene_app, SceneRequest, "show")
def show_scene(request: SceneRequest) -> None:
    """Show what is in a scene: instances, bounds, floors, starts, paths, lights, classes."""
    from omnisim.apps.cli.worlds.scene import run

    run(request)


@command(scene_app, SceneConvertRequest, "convert")
def convert_scene(request: SceneConvertRequest) -> None:
    """Write a scene of any format as GLB: instances, materials, textures, lights."""
    from omnisim.apps.cli.worlds.scene_convert import run

    run(request)


@command(app, BakeRequest)
def bake(request: BakeRequest) -> None:
    """Bake a scene's light: shadows, sky and bounces on all that is static."""
    from omnisim.apps.cli.worlds.bake import run

    run(request)


@command(app, RenderRequest)
def render(request: RenderRequest) -> None:
    """Render a frame, or a rig along a trajectory, with ground truth."""
    from omnisim.apps.cli.images.render import run

    run(request)


@command(app, LiveRequest)
def live(request: LiveRequest) -> None:
    """Serve a page: the camera in a browser, driven by keys, every parameter a control."""
    from omnisim.apps.cli.images.live import run

    run(request)


@command(app, DriveRequest)
def drive(request: DriveRequest) -> None:
    """Drive a robot along a path and record images, scans, odometry and ground truth."""
    from omnisim.apps.cli.runs.drive import run

    run(request)


@command(app, LocalizeRequest)
def localize(request: LocalizeRequest) -> None:
    """Localize the robot of a run by its odometry and the landmarks in its images."""
    require_extra("reports", "omnisim localize")
    from omnisim.apps.cli.runs.localize import run

    run(request)


@command(app, PlotRequest)
def plot(request: PlotRequest) -> None:
    """Plot a run from above: map, path, odometry, landmarks, images."""
    require_extra("plots", "omnisim plot")
    from omnisim.apps.cli.runs.plot import run

    run(request)


@command(app, VideoRequest)
def video(request: VideoRequest) -> None:
    """Encode the images of a run as a video."""
    require_extra("video", "omnisim video")
    from omnisim.apps.cli.images.video import run

    run(request)


@command(app, ExportRequest)
def export(request: ExportRequest) -> None:
    """Export a run for other tools: ROS 2 bags, data sets, structure from motion."""
    from omnisim.apps.cli.runs.export import run

    run(request)


@command(app, UnwarpRequest)
def unwarp(request: UnwarpRequest) -> None:
    """Unwarp an omnidirectional image to a cylinder, a perspective view or a map."""
    from omnisim.apps.cli.images.unwarp import run

    run(request)


@command(app, ScanRequest)
def scan(request: ScanRequest) -> None:
    """Take one scan with a laser scanner, a SICK LMS200."""
    from omnisim.apps.cli.images.scan import run

    run(request)


@command(app, ValidateRequest)
def validate(request: ValidateRequest) -> None:
    """Validate the geometry by the paper's figures and independent oracles; 1 if a bound fails."""
    require_extra("reports", "omnisim validate")
    from omnisim.apps.cli.checks.validate import run

    if not run(request):
        raise typer.Exit(1)


@command(app, ExperimentsRequest)
def experiments(request: ExperimentsRequest) -> None:
    """Repeat the paper's experiments in self-localization; 1 if a bound fails."""
    require_extra("reports", "omnisim experiments")
    from omnisim.apps.cli.checks.experiments import run

    if not run(request):
        raise typer.Exit(1)


@command(app, MirrorRequest)
def mirror(request: MirrorRequest) -> None:
    """Write the mirror's mesh, textured for the unfolded cube, to open in Blender."""
    from omnisim.apps.cli.cameras.mirror import run

    run(request)


@command(app, SensorRequest)
def sensor(request: SensorRequest) -> None:
    """Print the default sensor file, every key with a comment, or check one."""
    from omnisim.apps.cli.cameras.sensor import run

    run(request)


@robot_app.command("list", cls=Command)
def list_robots() -> None:
    """List the built-in robots."""
    from omnisim.apps.cli.runs.robot import list_robots

    list_robots()


@command(robot_app, CheckRequest, "check")
def check_robot(request: CheckRequest) -> None:
    """Check a robot file with its body and sensors, and summarize it."""
    from omnisim.apps.cli.runs.robot import check_robot

    check_robot(request)


@command(robot_app, ImportRequest, "import")
def import_robot(request: ImportRequest) -> None:
    """Convert a robot of USARSim, Gazebo, URDF or MuJoCo to a robot file."""
    from omnisim.apps.cli.runs.robot import import_robot

    import_robot(request)


@command(landmarks_app, TrainRequest, "train")
def train_landmarks(request: TrainRequest) -> None:
    """Learn the colors from a run that was driven with --also instance."""
    from omnisim.apps.cli.runs.landmarks import train

    train(request)


@command(landmarks_app, DetectRequest, "detect")
def detect_landmarks(request: DetectRequest) -> None:
    """Detect landmarks with range and bearing in an image, or in all images of a run."""
    from omnisim.apps.cli.runs.landmarks import detect

    detect(request)


@command(calibration_app, ConvertRequest, "convert")
def convert_calibration(request: ConvertRequest) -> None:
    """Convert a calibration to another format, exactly or by the best fit, with its residual."""
    from omnisim.apps.cli.cameras.calibration import convert

    convert(request)


@command(calibration_app, ShowRequest, "show")
def show_calibration(request: ShowRequest) -> None:
    """Show the cameras of a calibration file: model, parameters, field of view, valid domain."""
    from omnisim.apps.cli.cameras.calibration import show

    show(request)


@calibration_app.command("formats", cls=Command)
def list_formats() -> None:
    """List the formats, and the camera models that each represents exactly."""
    from omnisim.apps.cli.cameras.calibration import list_formats

    list_formats()


@command(optics_app, OpticsCheckRequest, "check")
def check_optics(request: OpticsCheckRequest) -> None:
    """Check an optical system, and measure the errors of a central model of it by distance."""
    from omnisim.apps.cli.cameras.optics import check

    check(request)


@command(optics_app, OpticsPlotRequest, "plot")
def plot_optics(request: OpticsPlotRequest) -> None:
    """Plot an optical system: profile, rays, caustic, resolution by image radius."""
    require_extra("plots", "omnisim optics plot")
    from omnisim.apps.cli.cameras.optics import plot

    plot(request)


@command(optics_app, OpticsRaysRequest, "rays")
def write_optics_rays(request: OpticsRaysRequest) -> None:
    """Write the ray of each pixel, origin and direction, as a table."""
    from omnisim.apps.cli.cameras.optics import rays

    rays(request)


@command(optics_app, OpticsDesignRequest, "design")
def design_optics(request: OpticsDesignRequest) -> None:
    """Design a mirror's profile: constant resolution by angle, or on the ground."""
    from omnisim.apps.cli.cameras.optics import design

    design(request)


@command(optics_app, OpticsProfileRequest, "profile")
def write_optics_profile(request: OpticsProfileRequest) -> None:
    """Write the profile of a surface, for a lathe."""
    from omnisim.apps.cli.cameras.optics import profile

    profile(request)


@command(optics_app, OpticsCalibrateRequest, "calibrate")
def calibrate_optics(request: OpticsCalibrateRequest) -> None:
    """Fit an optical system's own parameters to the corners of a board in images."""
    from omnisim.apps.cli.cameras.optics_calibration import calibrate

    calibrate(request)


@command(app, GenerateRequest)
def generate(request: GenerateRequest) -> None:
    """Generate a data set from a plan: shards of samples, each a function of its number."""
    from omnisim.apps.cli.datasets.generate import run

    run(request)


@command(dataset_app, DatasetInfoRequest, "info")
def dataset_info(request: DatasetInfoRequest) -> None:
    """Show what is in a data set: samples, scenes, cameras, channels, size."""
    from omnisim.apps.cli.datasets.dataset import info

    info(request)


@command(dataset_app, DatasetCheckRequest, "check")
def dataset_check(request: DatasetCheckRequest) -> None:
    """Compare the hash of each shard with the manifest's."""
    from omnisim.apps.cli.datasets.dataset import check

    check(request)


@command(dataset_app, DatasetConvertRequest, "convert")
def dataset_convert(request: DatasetConvertRequest) -> None:
    """Write a data set in another layout: COCO's, KITTI-360's, nerfstudio's or COLMAP's."""
    from omnisim.apps.cli.datasets.dataset import convert

    convert(request)


@command(dataset_app, DatasetViewRequest, "view")
def dataset_view(request: DatasetViewRequest) -> None:
    """Write a sheet of samples with their channels."""
    from omnisim.apps.cli.datasets.dataset import view

    view(request)


for group in (scene_app, robot_app, landmarks_app, calibration_app, optics_app, dataset_app):
    app.add_typer(group)


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        out.print(f"omnisim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Parse the options of `omnisim` itself."""


def main() -> None:
    """Run the command line; an error that a user can act on is one line and exit status 1."""
    try:
        app(prog_name="omnisim")
    except SystemExit as stopped:
        if stopped.code == INTERRUPTED:  # typer prints nothing
            err.print("interrupted")
        raise
    except OmnisimError as error:
        _fail(str(error))
    except OSError as error:
        if error.filename is not None:
            raise
        if error.errno == errno.ENOENT:  # of getcwd
            _fail("the working directory is not there any more")
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the end flushes it again
        _fail(f"standard output: cannot be written: {error.strerror}")


def _fail(message: str) -> NoReturn:
    from rich.markup import escape

    for line in message.splitlines():
        err.print(f"[bold red]error:[/] {escape(line)}")
    sys.exit(1)
