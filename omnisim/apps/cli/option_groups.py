"""Groups of options that several commands share; see `omnisim.apps.cli.options`."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, ClassVar

from omnisim.apps.cli import completion
from omnisim.apps.cli.options import Argument, Option
from omnisim.core.package_files import preset_names

# Headings on help pages.
CAMERA, VIEWPOINT, TRAJECTORY, GROUND_TRUTH = "Camera", "Viewpoint", "Trajectory", "Ground truth"


class PoseAxes(StrEnum):
    """Axes of the poses in a trajectory file."""

    KITTI = "kitti"
    WORLD = "world"


class Backend(StrEnum):
    """Back ends of `Renderer`."""

    CUBE = "cube"
    RAYS = "rays"


Resources = Annotated[
    list[Path] | None,
    Option(
        metavar="DIR",
        default="GZ_SIM_RESOURCE_PATH, GAZEBO_MODEL_PATH, ROS_PACKAGE_PATH, "
        "and folders around the scene's",
    ),
]
Position = tuple[float, float, float] | None
RobotName = Annotated[
    str | None, Option(metavar="NAME|FILE", complete=completion.complete_robot, example="p2at")
]
RunFolder = Annotated[Path, Argument(metavar="RUN")]
Mirrored = Annotated[
    bool | None,
    Option(flags=("--mirrored/--not-mirrored",), default="by the file's metadata, else not"),
]


@dataclass(frozen=True, kw_only=True)
class FileUnitOptions:
    """Axes and unit of a scene file, and folders of its models."""

    up_axis: Annotated[
        str | None,
        Option(
            flags=("--up",), metavar="x|y|z", default="the format's", names=lambda: ("x", "y", "z")
        ),
    ] = None
    """Up axis of the scene file."""
    meters_per_unit: Annotated[float | None, Option(metavar="M", default="the format's")] = None
    """Meters per unit of the scene file, such as 0.001 for millimeters."""
    resources: Resources = None
    """Folder of models that the scene references by URI, such as model://chair; can be repeated."""


@dataclass(frozen=True, kw_only=True)
class SceneOptions(FileUnitOptions):
    """Scene of a command."""

    scene: Annotated[str, Argument(metavar="SCENE", complete=completion.complete_scene)]
    """Scene file (.glb .gltf .obj .ply .stl .dae .usd .sdf .world .urdf, MuJoCo's .xml, or a
    scene's .toml), or name of a built-in scene."""


@dataclass(frozen=True, kw_only=True)
class LightOptions:
    """Light that replaces the scene's own."""

    unlit: bool = False
    """Render plain base colors, without lights."""
    sky: Annotated[
        str | None,
        Option(metavar="clear|none|FILE", default="the scene's", names=lambda: ("clear", "none")),
    ] = None
    """Sky that replaces the scene's sky and sun: clear (around the scene's sun, if it has one),
    none, or an environment map (.hdr or .exr)."""
    baked: Annotated[
        Path | None, Option(metavar="DIR|none", default="from the scene's TOML, else none")
    ] = None
    """Folder of the scene's baked light from `omnisim bake`; none: light from lamps and sky."""


@dataclass(frozen=True, kw_only=True)
class ShadowedLightOptions(LightOptions):
    """Light of the scene and its shadows."""

    no_shadows: bool = False
    """Disable shadows."""


@dataclass(frozen=True, kw_only=True)
class CameraFileOptions:
    """File of the camera, of one of three types."""

    panel: ClassVar[str] = CAMERA

    sensor: Annotated[Path | None, Option(default="the paper's camera")] = None
    """Sensor file: .toml."""
    optics: Path | None = None
    """Optics file in place of a sensor file: mirrors and refracting surfaces in front of a
    camera."""
    calibration_file: Annotated[Path | None, Option(flags=("--camera",))] = None
    """Calibration file in place of a sensor file: Kalibr, OpenCV, COLMAP, … (`omnisim calibration
    formats`), or KITTI-360's folder."""
    camera_name: Annotated[str | None, Option(metavar="NAME", default="the first")] = None
    """Name of the camera in the calibration file."""
    mirrored: Mirrored = None
    """The camera of the calibration file looks into a mirror."""


@dataclass(frozen=True, kw_only=True)
class ImageOptions:
    """Image settings that override those of the camera's file."""

    panel: ClassVar[str] = CAMERA

    size_px: Annotated[int | None, Option(default="the camera's")] = None
    """Length of the image's shorter side in pixels."""
    quality: Annotated[
        str | None,
        Option(
            metavar="fast|default|fine",
            default="the sensor file's",
            names=lambda: ("fast", "default", "fine"),
        ),
    ] = None
    """Preset of samples per pixel and of the virtual cameras' resolution."""
    preset: Annotated[
        str | None,
        Option(metavar="NAME|FILE", default="the sensor file's", names=preset_names),
    ] = None
    """Degradations of the camera ({names}), or a .toml file."""
    exposure_ev: Annotated[
        str | None, Option(metavar="EV|auto", default="the camera's", names=lambda: ("auto",))
    ] = None
    """Override of the camera's exposure: stops (each doubles the light), or auto (metered in each
    image)."""


@dataclass(frozen=True, kw_only=True)
class MeshImageOptions(ImageOptions):
    """Image of the camera, and polygons of its mirror."""

    polygons: Annotated[
        str | None,
        Option(
            flags=("-n", "--polygons"),
            metavar="N|auto|exact",
            default="auto, exact for optics, or the sensor file's",
        ),
    ] = None
    """Number of polygons of the mirror's mesh; auto: as many as 0.1 px accuracy needs."""


@dataclass(frozen=True, kw_only=True)
class ViewpointOptions:
    """Viewpoint and time."""

    panel: ClassVar[str] = VIEWPOINT

    at: Annotated[Position, Option(metavar="X Y Z", default="the scene's start")] = None
    """Position of the viewpoint in meters, z up."""
    yaw_deg: Annotated[float | None, Option(default="the scene's start")] = None
    """Heading, counter-clockwise from +x."""
    pitch_deg: float = 0.0
    """Downward tilt of the front."""
    time_s: float = 0.0
    """World time in seconds, for moving objects."""


@dataclass(frozen=True, kw_only=True)
class TiltedViewpointOptions(ViewpointOptions):
    """Viewpoint with any attitude, and time."""

    roll_deg: float = 0.0
    """Downward tilt of the right side."""


@dataclass(frozen=True, kw_only=True)
class TruthOptions:
    """Ground truth to write."""

    panel: ClassVar[str] = GROUND_TRUTH

    also: Annotated[
        str | None,
        Option(
            metavar="CHANNELS",
            names=completion.channel_names,
            complete=completion.complete_channels,
        ),
    ] = None
    """Ground-truth channels, comma-separated, or all: {names}."""
    channel_format: Annotated[
        str | None,
        Option(metavar="auto|npy|both", default="auto", names=lambda: ("auto", "npy", "both")),
    ] = None
    """Files of the channels: auto (EXR layers, or PNG and others), npy (one .npy each), or both."""
    boxes_3d: bool = False
    """Also write oriented 3-D boxes of the visible instances."""
    labels: Annotated[Path | None, Option(default="the scene's own labels")] = None
    """Label file: .toml."""


def _device_number(text: str) -> int:
    if text.isdecimal():
        return int(text)
    from omnisim.rendering.opengl.gl.devices import device_number  # EGL is seldom needed

    return device_number(text)


@dataclass(frozen=True, kw_only=True)
class DeviceOptions:
    """GPU to render on."""

    device: Annotated[
        int | None, Option(metavar="N|cuda:N", default="the first", parse=_device_number)
    ] = None
    """Index of the GPU, as `omnisim info` lists it, or its number in CUDA."""


@dataclass(frozen=True, kw_only=True)
class BackendOptions(DeviceOptions):
    """Back end of the renderer."""

    backend: Backend = Backend.CUBE
    """Renderer: cube (virtual cameras on the faces of a cube, by OpenGL), or rays (cast by Embree,
    slower, without OpenGL)."""


@dataclass(frozen=True, kw_only=True)
class RunSceneOptions:
    """Scene of a recorded run."""

    scene: Annotated[
        str | None,
        Option(metavar="SCENE", default="the recorded one", complete=completion.complete_scene),
    ] = None
    """Scene of the run, if it has moved."""


@dataclass(frozen=True, kw_only=True)
class RunCameraOptions:
    """Camera of a recorded run."""

    camera_name: Annotated[
        str | None,
        Option(metavar="NAME", default="the first", complete=completion.complete_run_camera),
    ] = None
    """Name of the run's camera."""
