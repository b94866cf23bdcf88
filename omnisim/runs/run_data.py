"""Recorded runs and single images as data for landmark detection, training and localization."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import summary
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import OpticsError, OutputError, RunError
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.core.trajectories.odometry import Odometry
from omnisim.ground_truth.channel_files import StoredChannels
from omnisim.ground_truth.label_names import Labels
from omnisim.perception.landmarks.color_model import (
    VALIDATE_EVERY,
    Costs,
    LabeledPixels,
    Training,
    train_colors,
)
from omnisim.perception.unwarping import CameraMount
from omnisim.rendering.camera.captured_image import read_captured_image
from omnisim.rendering.camera.omnicamera import CALIBRATION, IMAGE_SUFFIX, OmniCamera
from omnisim.robots import read_odometry
from omnisim.runs.run_folder import GROUND_TRUTH, LABELS, ODOMETRY, RunFolder
from omnisim.scene import Scene
from omnisim.scene.model import Landmark
from omnisim.sensors.calibration_file import read_colors, read_mount


@dataclass(frozen=True, eq=False)
class RunData:
    """Run with one of its cameras."""

    folder: RunFolder  # folder of the run
    camera: str  # name of the camera
    # camera on the vehicle, from its calibration file, independent of the vehicle's pose. An
    # optical system gets an assumed viewpoint.
    mount: CameraMount
    scene: Scene  # scene of the drive
    odometry: Odometry  # readings of the wheels, from the known start on
    truth: Trajectory | None  # poses of the base, or None: unknown
    steps: int  # number of steps with an image

    def __repr__(self) -> str:
        return short_repr(self, self.name, self.camera, counted(self.steps, "step"))

    @property
    def name(self) -> str:
        """Robot, scene and path, for titles."""
        return self.folder.manifest.title

    @property
    def landmarks(self) -> tuple[Landmark, ...]:
        """Landmarks of the scene."""
        return self.scene.landmarks

    @property
    def true_poses(self) -> Floats | None:
        """True x, y, yaw (steps, 3), or None: unknown."""
        return None if self.truth is None else planar_poses(self.truth)[: self.steps]

    def image(self, step: int) -> Bytes:
        """Image (height, width, 3) of a step, sRGB; see `read_colors`."""
        return read_colors(self.folder.file(self.camera, step, IMAGE_SUFFIX), self.mount.camera)

    @property
    def notices(self) -> list[str]:
        """Notices: the run is incomplete, or an assumed viewpoint of a non-central camera."""
        caveat = None if self.mount.caveat is None else f"{self.camera}: {self.mount.caveat}"
        return [notice for notice in (self.folder.unfinished(), caveat) if notice is not None]

    def images(self) -> Iterator[Bytes]:
        """Images (height, width, 3) of all steps in order, sRGB."""
        return (self.image(step) for step in range(self.steps))


def planar_poses(trajectory: Trajectory) -> Floats:
    """x, y, yaw (n, 3) of a trajectory."""
    return np.column_stack((trajectory.positions_m[:, :2], trajectory.yaw_rad))


def read_run(folder: Path, scene: str | None = None, camera: str | None = None) -> RunData:
    """Read a run, complete or not, with a camera; by default the first.

    `scene` is the file or name of the run's scene, if it has moved.

    Raises:
        OmnisimError: no run, no camera, no image yet, no landmarks, or a damaged file.
    """
    run = RunFolder.read(folder)
    name = run.camera(camera)
    if run.has_own_rate(name):
        raise RunError(
            f"{folder}: camera {name!r} has a rate of its own: expected an image at each step, "
            "where the wheels are read"
        )
    recorded = run.manifest.scene
    run_scene = recorded.load(scene)
    if not run_scene.landmarks:
        raise RunError(
            f"{folder}: its scene {run_scene.name} has no [[landmarks]]: expected a scene with some"
        )
    steps = run.steps_done()
    if steps == 0:
        raise RunError(f"{folder}: has no images yet: run its command again to resume it")
    if run.manifest.is_rig:
        raise RunError(f"{folder}: expected the run of a robot with wheels, got that of a rig")
    odometry = read_odometry(folder / ODOMETRY)
    run.check_steps(ODOMETRY, len(odometry.times_s))
    truth = read_trajectory(folder / GROUND_TRUTH) if run.has(GROUND_TRUTH) else None
    if truth is not None:
        run.check_steps(GROUND_TRUTH, len(truth))
    mount = read_mount(folder / name / CALIBRATION).assuming_viewpoint()
    return RunData(run, name, mount, run_scene, odometry, truth, steps)


# Labels of a run's images: the ground truth for the training of color histograms.
#
# They come from the run's own channel `instance`, recorded by `omnisim drive ... --also instance`.
# The scene's nodes are named after their landmark, `goal_yellow`; bands of a landmark with several
# colors are also named after their color, `beacon_left_yellow_pink`.


# Minimum saturation, (largest − smallest)/largest of linear RGB, of a landmark's color. It excludes
# white lines, walls and paper, which are everywhere.
MIN_SATURATION = 0.5
Track = Callable[[Iterable[int]], Iterable[int]]


def landmark_colors(landmarks: Sequence[Landmark]) -> tuple[str, ...]:
    """Names of the saturated colors of landmarks, in alphabetical order."""
    colors = set()
    for landmark in landmarks:
        for band in landmark.bands:
            brightest = max(band.linear_rgb)
            if brightest > 0.0 and 1.0 - min(band.linear_rgb) / brightest >= MIN_SATURATION:
                colors.add(band.color)
    return tuple(sorted(colors))


class RunLabels:
    """Classes of the pixels of a run's images: 1, 2, ... for the names of landmark colors.

    Raises:
        RunError: the run lacks the channel, or its table of labels is damaged.
    """

    def __init__(self, run: RunData, colors: Sequence[str]):
        path = run.folder.path
        if "instance" not in run.folder.manifest.channels:
            raise RunError(
                f"{path}: has no labels to learn from: drive it again into a new folder with "
                "--also instance"
            )
        self._run = run
        self._class_of_instance = _class_of_instance(run, colors)

    def __call__(self, step: int) -> Bytes:
        """Class of each pixel (height, width): 0, or 1 + the index of a color.

        Raises:
            RunError: the step's file has unknown instances.
            OutputError: the file is missing or damaged.
        """
        image = self._run.folder.file(self._run.camera, step, IMAGE_SUFFIX)
        ids: NDArray[np.uint32]
        ids = StoredChannels(image, {}).read(["instance"])["instance"]
        if ids.max(initial=0) >= len(self._class_of_instance):
            raise RunError(f"{image}: channel 'instance': has instances that are not in {LABELS}")
        return self._class_of_instance[ids]

    def pixels(self, track: Track = iter) -> Iterator[LabeledPixels]:
        """Pixels (n, 3) that show the scene, and their classes (n,), image by image."""
        covered = self._run.mount.covered
        selected = slice(None) if covered is None else covered.ravel()
        for step in track(range(self._run.steps)):
            yield self._run.image(step).reshape(-1, 3)[selected], self(step).ravel()[selected]


def train_on_run(run: RunData, costs: Costs, track: Track = iter) -> Training:
    """Train a color model on a run's landmarks; `track` wraps the steps, for progress.

    Raises:
        RunError: a run without labels, or with too few images.
        LocalizationError: a color is visible in no image.
    """
    colors = landmark_colors(run.landmarks)
    labels = RunLabels(run, colors)
    if run.steps < VALIDATE_EVERY:
        raise RunError(
            f"{run.folder.path}: expected at least {VALIDATE_EVERY} images to train on some and "
            f"choose Θ by others, got {run.steps}"
        )
    return train_colors(colors, labels.pixels(track), costs)


def _class_of_instance(run: RunData, colors: Sequence[str]) -> Bytes:
    """Classes (n,) by instance ID."""
    path = run.folder.path / LABELS
    classes: dict[str, int] = {}
    for landmark in run.landmarks:
        for band in landmark.bands:
            if band.color in colors:
                classes[f"{landmark.name}_{band.color}"] = 1 + colors.index(band.color)
                if len(landmark.bands) == 1:
                    classes[landmark.name] = 1 + colors.index(band.color)
    try:
        labels = Labels.from_json(json.loads(path.read_text(encoding="utf-8")))
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except (KeyError, TypeError, ValueError, RecursionError):
        raise RunError(f"{path}: is damaged: not a table of labels") from None
    # objects that move with the vehicle are no landmarks, whatever their names
    fixed = (
        0 if instance.object_name else classes.get(instance.name, 0)
        for instance in labels.instances
    )
    return np.array([0, *fixed], dtype=np.uint8)


# Single images with their camera, for landmark detection.


@dataclass(frozen=True, eq=False)
class SingleImage:
    """Image of a camera, as a run of one step."""

    mount: CameraMount  # camera on its vehicle
    pixels: Bytes  # (height, width, 3), sRGB
    steps: ClassVar[int] = 1

    def __repr__(self) -> str:
        return short_repr(self, summary(self.mount.camera))

    @property
    def notices(self) -> list[str]:
        """Notices: an assumed viewpoint of a non-central camera."""
        return [] if self.mount.caveat is None else [self.mount.caveat]

    def image(self, step: int) -> Bytes:
        """Image (height, width, 3) at step 0, the only step, sRGB."""
        return self.pixels


def read_single_image(
    path: Path, height_m: float | None = None, sensor: OmniCamera | None = None
) -> SingleImage:
    """Read an image whose metadata names its camera.

    The metadata gives the camera's mount on its vehicle; the vehicle's pose is ignored. `height_m`
    is the effective viewpoint's above the ground; None: the mount's z. `sensor` is the camera on
    its vehicle; None: that of the metadata.

    Raises:
        OutputError: not an image, an image of floats, or an image without its camera.
        OpticsError: an invalid height.
    """
    captured = read_captured_image(path, sensor)
    if captured.pixels.dtype != np.uint8:
        raise OutputError(f"{path}: has linear floats: expected an image of 8 bits, .png")
    viewpoint_height_m = height_m
    if height_m is None:
        height_m = captured.height_m if sensor is None else float(sensor.base_from_optical[2, 3])
    if height_m is None or not (math.isfinite(height_m) and height_m > 0.0):
        raise OpticsError(
            f"{path}: camera {height_m} m above the ground: expected more than 0: pass "
            "--height METERS"
        )
    base_from_optical = np.eye(4)
    base_from_optical[:3, :3] = captured.base_from_optical
    if sensor is not None:
        base_from_optical[:3, 3] = sensor.base_from_optical[:3, 3]
    elif captured.world_from_base is not None and captured.world_from_optical is not None:
        arm = captured.world_from_optical[:3, 3] - captured.world_from_base[:3, 3]
        base_from_optical[:3, 3] = captured.world_from_base[:3, :3].T @ arm
    base_from_optical[2, 3] = height_m
    mount = CameraMount(captured.camera, base_from_optical, captured.covered).assuming_viewpoint()
    if viewpoint_height_m is not None:
        mount.base_from_optical[2, 3] = viewpoint_height_m
    return SingleImage(mount, captured.pixels)
