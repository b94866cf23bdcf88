"""Recorded runs as data for landmark detection and localization."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import RunError
from omnisim.core.files.image_files import read_image
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.core.trajectories.odometry import Odometry
from omnisim.perception.unwarping.panorama import CameraMount
from omnisim.rendering.camera.omnicamera import CALIBRATION
from omnisim.robots import read_odometry
from omnisim.runs.run_folder import GROUND_TRUTH, ODOMETRY, RunFolder
from omnisim.scene import Scene
from omnisim.scene.model import Landmark
from omnisim.sensors.calibration_file import read_mount


@dataclass(frozen=True, eq=False)
class RunData:
    """Run with one of its cameras.

    Attributes:
        folder: folder of the run.
        camera: name of the camera.
        mount: camera on the vehicle, from its calibration file, independent of the vehicle's pose.
            An optical system gets an assumed viewpoint.
        scene: scene of the drive.
        odometry: readings of the wheels, from the known start on.
        truth: poses of the base, or None: unknown.
        steps: number of steps with an image.
    """

    folder: RunFolder
    camera: str
    mount: CameraMount
    scene: Scene
    odometry: Odometry
    truth: Trajectory | None
    steps: int

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
    def true_poses(self) -> NDArray[np.float64] | None:
        """True x, y, yaw (steps, 3), or None: unknown."""
        return None if self.truth is None else planar_poses(self.truth)[: self.steps]

    def image(self, step: int) -> NDArray[np.uint8]:
        """Read the image (height, width, 3) of a step, sRGB.

        Raises:
            OutputError: the image is damaged.
            RunError: the image is not this camera's: of another size, or without 8 bits and 3
                colors.
        """
        path = self.folder.file(self.camera, step, ".png")
        pixels, _ = read_image(path)
        height, width, channels = pixels.shape
        camera = self.mount.camera
        expected = (camera.height_px, camera.width_px)
        if (height, width) != expected or channels < 3 or pixels.dtype != np.uint8:
            raise RunError(
                f"{path}: has {width} × {height} px of {channels} × {pixels.dtype}: expected this "
                f"camera's {camera.width_px} × {camera.height_px} px of 3 × uint8"
            )
        return np.ascontiguousarray(pixels[..., :3])

    @property
    def notices(self) -> list[str]:
        """Notices: the run is incomplete, or an assumed viewpoint of a non-central camera."""
        caveat = None if self.mount.caveat is None else f"{self.camera}: {self.mount.caveat}"
        return [notice for notice in (self.folder.unfinished(), caveat) if notice is not None]

    def images(self) -> Iterator[NDArray[np.uint8]]:
        """Images (height, width, 3) of all steps in order, sRGB."""
        return (self.image(step) for step in range(self.steps))


def planar_poses(trajectory: Trajectory) -> NDArray[np.float64]:
    """x, y, yaw (n, 3) of a trajectory."""
    return np.column_stack((trajectory.positions_m[:, :2], trajectory.yaw_rad))


def read_run(folder: Path, scene: str | None = None, camera: str | None = None) -> RunData:
    """Read a run, complete or not.

    Args:
        folder: folder of the run.
        scene: file or name of the run's scene, if it has moved.
        camera: name of a camera; by default the first.

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
