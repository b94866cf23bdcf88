"""Arguments and options that several commands share."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.completion import (
    CHANNELS,
    PRESETS,
    complete_channels,
    complete_run_camera,
    complete_scene,
    one_of,
)

# Panels of a help page.
CAMERA, VIEWPOINT, TRAJECTORY = "Camera", "Viewpoint", "Trajectory"
GROUND_TRUTH = "Ground truth"


class PoseAxes(StrEnum):
    """Axes of the poses of a trajectory file."""

    KITTI = "kitti"
    WORLD = "world"


class Backend(StrEnum):
    """Back ends of `Renderer`."""

    CUBE = "cube"
    RAYS = "rays"


BackendOption = Annotated[
    Backend,
    typer.Option(
        "--backend",
        help="Renderer: virtual cameras on the faces of a cube, by OpenGL; or rays cast by Embree, "
        "slower and without OpenGL.",
    ),
]
SceneArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        autocompletion=complete_scene,
        help="Scene file (.glb .gltf .obj .ply .stl .dae .usd .sdf .world .urdf, MuJoCo's .xml, or "
        "a scene's .toml), or name of a built-in scene.",
    ),
]
ImageOption = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        help="Image: .png .jpg .tif (sRGB) or .exr (linear).",
    ),
]
AtCameraOption = Annotated[
    str | None,
    typer.Option(
        "--at-camera",
        metavar="NAME",
        help="Viewpoint and attitude of a camera of the scene's file, as `omnisim scene` lists "
        "them.",
        rich_help_panel=VIEWPOINT,
    ),
]
AtOption = Annotated[
    tuple[float, float, float] | None,
    typer.Option(
        "--at",
        metavar="X Y Z",
        help="Viewpoint in meters, z up.",
        show_default="the scene's start",
        rich_help_panel=VIEWPOINT,
    ),
]
YawOption = Annotated[
    float | None,
    typer.Option(
        "--yaw",
        metavar="DEG",
        help="Heading, counter-clockwise from +x.",
        show_default="the scene's start",
        rich_help_panel=VIEWPOINT,
    ),
]
TimeOption = Annotated[
    float,
    typer.Option(
        "--time",
        metavar="S",
        help="Time of the world in seconds, where the scene's objects move.",
        rich_help_panel=VIEWPOINT,
    ),
]
PitchOption = Annotated[
    float,
    typer.Option(
        "--pitch", metavar="DEG", help="Tilt of the front downwards.", rich_help_panel=VIEWPOINT
    ),
]
RollOption = Annotated[
    float,
    typer.Option(
        "--roll", metavar="DEG", help="Tilt of the right side downwards.", rich_help_panel=VIEWPOINT
    ),
]
AxesOption = Annotated[
    PoseAxes | None,
    typer.Option(
        "--axes",
        help="Axes of a file's poses: kitti (x right, y down, z ahead) or world (x forward, "
        "y left, z up).",
        show_default="kitti for KITTI's files, else world",
        rich_help_panel=TRAJECTORY,
    ),
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Throw away another run that is in the folder.")
]
PolygonsOption = Annotated[
    str | None,
    typer.Option(
        "-n",
        "--polygons",
        metavar="N|auto|exact",
        help="Polygons of the mirror's mesh; auto: as many as 0.1 px need.",
        show_default="auto, of optics exact, or the sensor file's",
        rich_help_panel=CAMERA,
    ),
]
SensorOption = Annotated[
    Path | None,
    typer.Option(
        "--sensor",
        metavar="FILE",
        help="Sensor file: .toml.",
        show_default="the paper's camera",
        rich_help_panel=CAMERA,
    ),
]
OpticsOption = Annotated[
    Path | None,
    typer.Option(
        "--optics",
        metavar="FILE",
        help="Optics file instead of a sensor file: mirrors and refracting surfaces in front "
        "of a camera.",
        rich_help_panel=CAMERA,
    ),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(
        "--camera",
        metavar="FILE",
        help="Calibration file instead of a sensor file: Kalibr, OpenCV, COLMAP, … "
        "(`omnisim calibration formats`), or KITTI-360's folder.",
        rich_help_panel=CAMERA,
    ),
]
SizeOption = Annotated[
    int | None,
    typer.Option(
        "--size",
        metavar="PX",
        help="Pixels of the image's shorter side.",
        show_default="the camera's",
        rich_help_panel=CAMERA,
    ),
]
QualityOption = Annotated[
    str | None,
    typer.Option(
        "--quality",
        metavar="fast|default|fine",
        autocompletion=one_of("fast", "default", "fine"),
        help="Samples per pixel and resolution of the virtual cameras.",
        show_default="the sensor file's",
        rich_help_panel=CAMERA,
    ),
]
UnlitOption = Annotated[
    bool, typer.Option("--unlit", help="Show plain base colors, without lights.")
]
NoShadowsOption = Annotated[
    bool, typer.Option("--no-shadows", help="Let the light of lamps pass through surfaces.")
]
SkyOption = Annotated[
    str | None,
    typer.Option(
        "--sky",
        metavar="clear|none|FILE",
        autocompletion=one_of("clear", "none"),
        help="Sky that lights the scene instead of its own sky and sun: a clear one, around its "
        "sun if it has one; none; or an environment map, .hdr or .exr.",
        show_default="the scene's",
    ),
]
BakedOption = Annotated[
    Path | None,
    typer.Option(
        "--baked",
        metavar="DIR|none",
        help="Folder of the scene's baked light, as `omnisim bake` writes it; none: lamps and sky.",
        show_default="as the scene's TOML has it, else none",
    ),
]
UpOption = Annotated[
    str | None,
    typer.Option(
        "--up",
        metavar="x|y|z",
        autocompletion=one_of("x", "y", "z"),
        help="Up axis of the scene file.",
        show_default="its format's",
    ),
]
UnitOption = Annotated[
    float | None,
    typer.Option(
        "--meters-per-unit",
        metavar="M",
        help="Meters in a unit of the scene file: 0.001 for millimeters.",
        show_default="as its format has it",
    ),
]
ResourcesOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--resources",
        metavar="DIR",
        help="Folder of models that the scene names by URI, such as model://chair; can be "
        "repeated.",
        show_default="GZ_SIM_RESOURCE_PATH, GAZEBO_MODEL_PATH, ROS_PACKAGE_PATH, "
        "and folders around the scene's",
    ),
]
PresetOption = Annotated[
    str | None,
    typer.Option(
        "--preset",
        metavar="NAME|FILE",
        autocompletion=one_of(*PRESETS),
        help=f"Degradations of the camera: {', '.join(PRESETS)}, or a .toml file.",
        show_default="the sensor file's",
        rich_help_panel=CAMERA,
    ),
]
DeviceOption = Annotated[
    int | None,
    typer.Option(
        "--device",
        metavar="N",
        min=0,
        help="Number of the GPU, as `omnisim info` lists them.",
        show_default="the first",
    ),
]
AlsoOption = Annotated[
    str | None,
    typer.Option(
        "--also",
        metavar="CHANNELS",
        autocompletion=complete_channels,
        help=f"Ground-truth channels, comma-separated, or all: {' '.join(CHANNELS)}.",
        rich_help_panel=GROUND_TRUTH,
    ),
]
ChannelFormatOption = Annotated[
    str | None,
    typer.Option(
        "--channel-format",
        metavar="auto|npy|both",
        autocompletion=one_of("auto", "npy", "both"),
        help="Files of the channels: layers of an EXR, or PNG and others; an .npy each; or both.",
        show_default="auto",
        rich_help_panel=GROUND_TRUTH,
    ),
]
Boxes3dOption = Annotated[
    bool,
    typer.Option(
        "--boxes-3d",
        help="Also write oriented 3-D boxes of the visible instances.",
        rich_help_panel=GROUND_TRUTH,
    ),
]
LabelsOption = Annotated[
    Path | None,
    typer.Option(
        "--labels",
        metavar="FILE",
        help="Label file: .toml.",
        show_default="the scene's own labels",
        rich_help_panel=GROUND_TRUTH,
    ),
]
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")]
RunSceneOption = Annotated[
    str | None,
    typer.Option(
        "--scene",
        metavar="SCENE",
        autocompletion=complete_scene,
        help="Scene of the run, if it has moved.",
        show_default="where it was",
    ),
]
RunCameraOption = Annotated[
    str | None,
    typer.Option(
        "--camera-name",
        metavar="NAME",
        autocompletion=complete_run_camera,
        help="Camera of the run.",
        show_default="the first",
    ),
]
CameraNameOption = Annotated[
    str | None,
    typer.Option(
        "--camera-name",
        metavar="NAME",
        help="Camera of the calibration file.",
        show_default="the first",
        rich_help_panel=CAMERA,
    ),
]
MirroredOption = Annotated[
    bool | None,
    typer.Option(
        "--mirrored/--not-mirrored",
        help="The camera of the calibration file looks into a mirror, or not.",
        show_default="by the file's metadata, else not",
        rich_help_panel=CAMERA,
    ),
]
