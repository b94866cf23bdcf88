"""Groups of options that several commands share; see `omnisim.apps.cli.options`."""

from contextlib import suppress
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from omnisim.apps.cli import completion
from omnisim.apps.cli.options import Argument, Option, options
from omnisim.core.errors import OpticsError
from omnisim.core.package_files import preset_names

# Headings on help pages.
CAMERA, VIEWPOINT, TRAJECTORY, GROUND_TRUTH = "Camera", "Viewpoint", "Trajectory", "Ground truth"


Backend = Literal["cube", "rays"]
ChannelFiles = Annotated[
    Literal["auto", "npy", "both"] | None,
    Option(
        help="Files of the channels: auto (EXR layers, or PNG and others), npy (one .npy each), or "
        "both. Default: auto."
    ),
]
Axes = Annotated[
    Literal["kitti", "world"] | None,
    Option(
        help="Axes of a file's poses: kitti (x right, y down, z ahead) or world (x forward, y "
        "left, z up). Default: kitti for KITTI's files, else world."
    ),
]
Resources = Annotated[
    list[Path] | None,
    Option(
        metavar="DIR",
        help="Folder of models that the file references by URI, such as model://chair; can be "
        "repeated. Default: GZ_SIM_RESOURCE_PATH, GAZEBO_MODEL_PATH, ROS_PACKAGE_PATH, and the "
        "folders above the file.",
    ),
]
Position = Annotated[tuple[float, float, float] | None, Option(metavar="X Y Z")]
RobotName = Annotated[
    str | None, Option(metavar="NAME|FILE", complete=completion.complete_robot, example="p2at")
]
RunFolder = Annotated[Path, Argument(metavar="RUN", help="Folder of the run.")]
CameraName = Annotated[
    str | None,
    Option(metavar="NAME", help="Name of the camera in the calibration file. Default: the first."),
]
Mirrored = Annotated[
    bool | None,
    Option(
        flags=("--mirrored/--not-mirrored",),
        help="The camera of the calibration file looks into a mirror. Default: by the file's "
        "metadata, else not.",
    ),
]


def _exposure(text: str) -> float | Literal["auto"]:
    from omnisim.rendering.camera.degradations.effect import MAX_EV  # imports NumPy

    if text.lower() == "auto":
        return "auto"
    with suppress(ValueError):
        if abs(ev := float(text)) <= MAX_EV:  # NaN fails, too
            return ev
    raise OpticsError(
        f"--exposure-ev: expected −{MAX_EV:g} to {MAX_EV:g} stops, or auto, got {text!r}"
    )


Exposure = Annotated[
    float | Literal["auto"] | None,
    Option(metavar="EV|auto", names=lambda: ("auto",), parse=_exposure, example="auto"),
]
Polygons = Annotated[str | None, Option(flags=("-n", "--polygons"), metavar="N|auto|exact")]
Seconds = Annotated[float, Option(ge=-1e9, le=1e9)]  # some 30 years


@options
class FileUnitOptions:
    """Axes and unit of a scene file, and folders of its models."""

    up_axis: Annotated[Literal["x", "y", "z"] | None, Option(flags=("--up",))] = None
    """Up axis of the scene file. Default: the format's."""
    meters_per_unit: Annotated[float | None, Option(metavar="M")] = None
    """Meters per unit of the scene file, such as 0.001 for millimeters. Default: the format's."""
    resources: Resources = None


@options
class SceneOptions(FileUnitOptions):
    """Scene of a command."""

    scene: Annotated[str, Argument(metavar="SCENE", complete=completion.complete_scene)]
    """Scene file (.glb .gltf .obj .ply .stl .dae .usd .sdf .world .urdf, MuJoCo's .xml, or a
    scene's .toml), or name of a built-in scene."""


@options
class LightOptions:
    """Light that replaces the scene's own."""

    unlit: bool = False
    """Render plain base colors, without lights."""
    sky: Annotated[
        str | None, Option(metavar="clear|none|FILE", names=lambda: ("clear", "none"))
    ] = None
    """Sky that replaces the scene's sky and sun: clear (around the scene's sun, if it has one),
    none, or an environment map (.hdr or .exr). Default: the scene's."""
    baked: Annotated[Path | None, Option(metavar="DIR|none")] = None
    """Folder of the scene's baked light from `omnisim bake`; none: light from lamps and sky.
    Default: from the scene's TOML, else none."""


@options
class ShadowedLightOptions(LightOptions):
    """Light of the scene and its shadows."""

    no_shadows: bool = False
    """Disable shadows."""


@options
class CameraFileOptions:
    """File of the camera, of one of three types."""

    panel: ClassVar[str] = CAMERA

    sensor: Path | None = None
    """Sensor file: .toml. Default: the paper's camera."""
    optics: Path | None = None
    """Optics file in place of a sensor file: mirrors and refracting surfaces in front of a
    camera."""
    calibration_file: Annotated[
        Path | None, Option(flags=("--camera",), complete=completion.complete_camera)
    ] = None
    """Calibration file in place of a sensor file: Kalibr, OpenCV, COLMAP, … (`omnisim calibration
    formats`), or the folder of a rig's."""
    camera_name: CameraName = None
    mirrored: Mirrored = None


@options
class ImageOptions:
    """Image settings that override those of the camera's file."""

    panel: ClassVar[str] = CAMERA

    size_px: int | None = None
    """Length of the image's shorter side in pixels. Default: the camera's."""
    quality: Literal["fast", "default", "fine"] | None = None
    """Preset of samples per pixel and of the virtual cameras' resolution. Default: the sensor
    file's."""
    preset: Annotated[str | None, Option(metavar="NAME|FILE", names=preset_names)] = None
    """Degradations of the camera ({names}), or a .toml file. Default: the sensor file's."""
    exposure_ev: Exposure = None
    """Exposure of the camera: a number of stops (+1 doubles the light), or auto (metered in each
    image). Default: the camera's."""


@options
class MeshImageOptions(ImageOptions):
    """Image of the camera, and polygons of its mirror."""

    polygons: Polygons = None
    """Number of polygons of the mirror's mesh; auto: as many as 0.1 px accuracy needs; exact: no
    mesh. Default: the sensor file's, else auto, or exact for optics."""


@options
class ViewpointOptions:
    """Viewpoint and time."""

    panel: ClassVar[str] = VIEWPOINT

    at: Position = None
    """Position of the viewpoint in meters, z up. Default: the scene's start."""
    yaw_deg: float | None = None
    """Heading, counter-clockwise from +x. Default: the scene's start."""
    pitch_deg: float = 0.0
    """Downward tilt of the front."""
    time_s: Seconds = 0.0
    """World time in seconds, for moving objects."""


@options
class TiltedViewpointOptions(ViewpointOptions):
    """Viewpoint with any attitude, and time."""

    roll_deg: float = 0.0
    """Downward tilt of the right side."""


@options
class TruthOptions:
    """Ground truth to write."""

    panel: ClassVar[str] = GROUND_TRUTH

    also: Annotated[
        str | None,
        Option(
            metavar="CHANNELS",
            names=completion.names_of("ground_truth.channels.CHANNELS"),
            complete=completion.complete_channels,
        ),
    ] = None
    """Ground-truth channels, comma-separated, or all: {names}."""
    channel_format: ChannelFiles = None
    boxes_3d: bool = False
    """Also write oriented 3-D boxes of the visible instances."""
    labels: Path | None = None
    """Label file: .toml. Default: the scene's own labels."""


def _device_number(text: str) -> int:
    if text.isdecimal():
        return int(text)
    from omnisim.rendering.opengl.gl.diagnosis import device_number  # EGL is seldom needed

    return device_number(text)


@options
class DeviceOptions:
    """GPU to render on."""

    device: Annotated[int | None, Option(metavar="N|cuda:N", parse=_device_number)] = None
    """Index of the GPU, as `omnisim info` lists it, or its number in CUDA. Default: the first."""


@options
class BackendOptions(DeviceOptions):
    """Back end of the renderer."""

    backend: Backend = "cube"
    """Renderer: cube (virtual cameras on the faces of a cube, by OpenGL), or rays (cast by Embree,
    slower, without OpenGL)."""


@options
class RunSceneOptions:
    """Scene of a recorded run."""

    scene: Annotated[str | None, Option(metavar="SCENE", complete=completion.complete_scene)] = None
    """Scene of the run, if its file has moved. Default: the recorded one."""


@options
class RunCameraOptions:
    """Camera of a recorded run."""

    camera_name: Annotated[
        str | None, Option(metavar="NAME", complete=completion.complete_run_camera)
    ] = None
    """Name of the run's camera. Default: the first."""


@options
class EngineOptions:
    """Engine that distributes work."""

    engine: Literal["local", "ray"] = "local"
    """Engine that distributes the work."""
    address: Annotated[str | None, Option(metavar="ADDRESS")] = None
    """Address of the Ray cluster. Default: a cluster on this machine."""
