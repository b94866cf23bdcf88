"""Cameras, scenes and numbers that the options of several commands specify."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnisim.apps.cli import option_groups as groups
from omnisim.apps.cli.console import print_note
from omnisim.apps.cli.images.requests import CameraViewpointOptions
from omnisim.apps.cli.options import refuse_given
from omnisim.core.arrays import Floats
from omnisim.core.errors import (
    CalibrationError,
    OpticsError,
    OutputError,
    SceneError,
    SensorFileError,
    did_you_mean,
)
from omnisim.core.extras import require_extra
from omnisim.core.poses import pose
from omnisim.core.short_repr import number_text, point_text
from omnisim.ground_truth.channel_files import ChannelFormat
from omnisim.ground_truth.channels import CLASSES
from omnisim.rendering.baking.settings import emission_notes
from omnisim.rendering.camera.degradations import Degradation
from omnisim.rendering.camera.omnicamera import OmniCamera, Polygons
from omnisim.rendering.reflection_kinds import frosted_notes, reflection_notes
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene import Scene, read_scene
from omnisim.scene.labels import find_labels, read_label_file

LABELED = frozenset((*CLASSES, "instance"))  # channels whose files name classes

CALIBRATION_SUFFIXES = (".yaml", ".yml", ".json", ".txt")


@dataclass(frozen=True)
class Viewpoint:
    """Position and attitude in the world."""

    position_m: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    @classmethod
    def in_scene(cls, scene: Scene, options: groups.TiltedViewpointOptions) -> Viewpoint:
        """Viewpoint from --at, --yaw, --pitch and --roll; default: level at the scene's start."""
        if isinstance(options, CameraViewpointOptions) and options.at_camera is not None:
            tilts = "at", "yaw_deg", "pitch_deg", "roll_deg"
            refuse_given(options, "--at-camera has a pose of its own", *tilts)
            name, cameras = options.at_camera, {camera.name: camera for camera in scene.cameras}
            if name not in cameras:
                hint = did_you_mean(name, cameras) if cameras else "the scene's file has no cameras"
                raise OutputError(f"--at-camera {name!r}: {hint}")
            camera = cameras[name]
            return cls(camera.position_m, camera.yaw_deg, camera.pitch_deg, camera.roll_deg)
        start, at, yaw_deg = scene.start, options.at, options.yaw_deg
        position_m = start.position_m if at is None else at
        yaw_deg = start.yaw_deg if yaw_deg is None else yaw_deg
        return cls(position_m, yaw_deg, options.pitch_deg, options.roll_deg)

    def __str__(self) -> str:
        tilts = (("pitch", self.pitch_deg), ("roll", self.roll_deg))
        tilt = "".join(f", {name} {number_text(angle)}°" for name, angle in tilts if angle)
        return f"{point_text(self.position_m)} m at yaw {number_text(self.yaw_deg)}°{tilt}"

    @property
    def _angles_deg(self) -> dict[str, float]:
        return {"yaw_deg": self.yaw_deg, "pitch_deg": self.pitch_deg, "roll_deg": self.roll_deg}

    @property
    def pose(self) -> Floats:
        """Pose (4, 4) in the world."""
        return pose(self.position_m, **self._angles_deg)

    def base_of(self, camera: OmniCamera) -> Floats:
        """Pose (4, 4) world_from_base of a vehicle whose camera is at this viewpoint."""
        return camera.base_pose(self.position_m, **self._angles_deg)


def read_sensor(path: Path | None) -> OmniCamera:
    """Read the camera of a sensor file; None: the paper's camera."""
    if path is None:
        return OmniCamera()
    if path.suffix.lower() in CALIBRATION_SUFFIXES:
        raise SensorFileError(
            f"--sensor: expected a sensor file, got {path}: pass a calibration file as --camera"
        )
    return OmniCamera.from_file(path)


def read_camera(files: groups.CameraFileOptions, calibration: Path | None = None) -> OmniCamera:
    """Read the camera of a sensor, calibration or optics file; default: the paper's camera.

    `calibration` overrides the calibration file of the options.
    """
    calibration = calibration or files.calibration_file
    if files.optics is not None:
        for option, path in (("--sensor", files.sensor), ("--camera", calibration)):
            if path is not None:
                raise OpticsError(f"{option}, --optics: expected one of them, got both")
    if calibration is None:
        refuse_given(files, "requires --camera", "camera_name", "mirrored", error=CalibrationError)
        if files.optics is not None:
            from omnisim.cameras.optics.system_file import read_optics_file  # seldom needed

            return OmniCamera(read_optics_file(files.optics))
        return read_sensor(files.sensor)
    check_calibration_path(calibration, files.sensor)
    # only commands with a calibration pay the import time of formats and fits
    from omnisim.apps.cli.cameras.calibration import read_calibration, select_camera

    if str(calibration).startswith("catalog:"):
        reason = "expected none with a camera of the catalog"
        refuse_given(files, reason, "camera_name", "mirrored", error=CalibrationError)
        return OmniCamera.of_catalog(str(calibration))
    read = read_calibration(calibration, files.camera_name, None, files.mirrored)
    return OmniCamera(select_camera(read, files.camera_name).cameras[0].camera, polygons=None)


def check_calibration_path(calibration: Path, sensor: Path | None) -> None:
    """Raise an error for a sensor file in place of a calibration file, or beside one."""
    if sensor is not None:
        raise CalibrationError("--sensor, --camera: expected one of them, got both")
    if calibration.suffix.lower() == ".toml":
        raise CalibrationError(
            f"--camera: expected a calibration file, got the sensor file {calibration}: "
            "pass it as --sensor"
        )


def load_labeled_scene(
    world: groups.SceneOptions,
    light: groups.ShadowedLightOptions,
    truth: groups.TruthOptions,
    channels: Collection[str],
) -> Scene:
    """Load a scene with its own labels or those of --labels; print its notices.

    Only requested channels with classes print notices on labels.
    """
    is_labeled = truth.boxes_3d or not LABELED.isdisjoint(channels)
    if truth.labels is not None and not is_labeled:
        raise OutputError("--labels: requires --also semantic")
    scene = load_requested_scene(world, light)
    scene = with_shadows_as_requested(scene, light)
    if truth.labels is not None:
        rules = read_label_file(truth.labels)
        scene = scene.altered(f"labels {rules}", labels=rules)
    for notice in find_labels(scene).notices() if is_labeled else ():
        print_note(notice)
    return scene


def with_shadows_as_requested(scene: Scene, light: groups.ShadowedLightOptions) -> Scene:
    """Scene with its shadows, or without."""
    if not light.no_shadows:
        return scene
    return scene.altered("no shadows", lighting=scene.lighting.with_shadows(False))


def checked_backend(options: groups.BackendOptions) -> BackendName:
    """Check the options of the back end and return its name."""
    if options.backend == "cube":
        return "cube"
    if options.device is not None:
        raise OutputError("--device: expected --backend cube, got --backend rays")
    require_extra("rays", "--backend rays")
    return "rays"


def read_requested_scene(world: groups.SceneOptions, **settings: Any) -> Scene:
    """Read a scene with the requested axes and unit, and further arguments of `read_scene`."""
    if Path(world.scene).suffix.lower() in CALIBRATION_SUFFIXES:
        raise SceneError(
            f"{world.scene}: expected a scene, got another file: pass a calibration as --camera"
        )
    units = world.up_axis, world.meters_per_unit, world.resources or ()
    return read_scene(world.scene, *units, **settings)


def load_requested_scene(
    world: groups.SceneOptions, light: groups.LightOptions | None = None, **settings: Any
) -> Scene:
    """Read a scene with the requested axes, unit and light, and print its notices."""
    of_light = {} if light is None else {"sky": light.sky, "baked": light.baked}
    scene = read_requested_scene(world, **of_light, **settings)
    for notice in scene.notices:
        print_note(notice)
    return scene


def note_lighting(
    name: str, scene: Scene, backend: BackendName, sensors: Sequence[OmniCamera]
) -> None:
    """Print notes on emission without baked light, and reflections that the back end leaves out."""
    reflections: list[str] = []
    if backend == "cube":
        mirrors = min(sensor.mirrors for sensor in sensors)
        probes = min(sensor.reflection_probes for sensor in sensors)
        reflections = reflection_notes(scene, mirrors, probes)
    for note in (*emission_notes(scene), *reflections, *frosted_notes(scene, backend == "rays")):
        print_note(f"{name}: {note}")


def parse_channel_format(text: str | None, channels: Collection[str]) -> ChannelFormat:
    """Parse --channel-format."""
    if text is not None and not channels:
        raise OutputError("--channel-format: requires --also")
    return ChannelFormat.parse(text)


def read_preset(name: str | None) -> Degradation | None:
    """Read the degradations of a preset; None: keep those of the sensor file."""
    if name is None:
        return None
    from omnisim.rendering.camera.degradations import preset  # imports all effects

    return preset(name)


def parse_polygons(text: str) -> Polygons:
    """Parse a polygon count, "auto" or "exact"; returns None for "exact"."""
    if text.lower() == "exact":
        return None
    if text.lower() == "auto":
        return "auto"
    try:
        return int(text)
    except ValueError:
        raise OpticsError(
            f"-n: expected a number of polygons, 'auto' or 'exact', got {text!r}"
        ) from None
