"""Captured images with camera and pose, from the renderer or a recorded run."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.live.session import Draw, PageState
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import RunError
from omnisim.core.poses import pose_from_rotation, roll_pitch_yaw_from_rotation
from omnisim.core.trajectories import read_trajectory
from omnisim.ground_truth import Labels
from omnisim.ground_truth.channel_files import StoredChannels
from omnisim.rendering.camera.captured_image import read_captured_image
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.runs.run_folder import GROUND_TRUTH, RunFolder


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """Image with its camera and pose, live or replayed."""

    model: CentralCamera  # model of the camera
    # (4, 4) pose of the camera's optical frame on its vehicle
    base_from_optical: Floats
    world_from_base: Floats  # (4, 4) pose of the vehicle's base
    rgb: Bytes  # (height, width, 3) uint8 sRGB
    png: bytes | None  # contents of the image file; None for a coarse image
    channels: Mapping[str, NDArray[Any]]  # ground truth by name
    labels: Labels | None  # labels of the IDs in the channels; None: no labels

    @property
    def world_from_optical(self) -> Floats:
        """Pose (4, 4) of the camera's optical frame in the world."""
        return self.world_from_base @ self.base_from_optical

    @property
    def viewpoint(self) -> Place:
        """Position of the effective viewpoint and attitude of the vehicle, as for `render`."""
        x, y, z = self.world_from_optical[:3, 3].tolist()
        angles = np.degrees(roll_pitch_yaw_from_rotation(self.world_from_base[:3, :3]))
        roll, pitch, yaw = (float(angle) + 0.0 for angle in angles)
        return Place((x, y, z), yaw, pitch, roll)


def degrees(radians: float) -> float:
    """Convert an angle to degrees, rounded to thousandths."""
    return round(math.degrees(radians), 3) + 0.0


class RunSource:
    """Images of a run's camera, with the recorded channels.

    Args:
        scene: file or name of the scene, if it has moved; None: the recorded one.
        camera_name: name of the run's camera; None: the first.
        device: index of the GPU, for the map.

    Raises:
        OmnisimError: no run, no camera, no images yet, or a damaged file.
    """

    def __init__(
        self,
        folder: Path,
        scene: str | None = None,
        camera_name: str | None = None,
        device: int | None = None,
    ):
        self._run = RunFolder.read(folder)
        self._camera_name = self._run.camera(camera_name)
        recorded = self._run.manifest.scene
        self.scene = recorded.load(scene)
        self.steps = self._run.measurements_done(self._camera_name)
        if self.steps == 0:
            raise RunError(f"{folder}: has no images yet: run its command again to resume it")
        first = read_captured_image(self._image(0))
        self.camera = OmniCamera(first.camera, polygons=None)
        self.channel_names = self._run.channels_at(0, self._camera_name)
        self.stage = Stage(self.scene, device=device)

    def take(self, draw: Draw, channels: Collection[str]) -> LiveFrame:
        """Read the image of a step, with the requested channels that were recorded."""
        path = self._image(min(draw.state.step, self.steps - 1))
        frame = read_captured_image(path)
        stored = StoredChannels(path, frame.metadata)
        names = [name for name in stored.names if name in set(channels)]
        base = np.eye(4) if frame.world_from_base is None else frame.world_from_base
        arm_m = np.zeros(3)
        if frame.world_from_optical is not None:
            arm_m = base[:3, :3].T @ (frame.world_from_optical[:3, 3] - base[:3, 3])
        base_from_optical = pose_from_rotation(frame.base_from_optical, arm_m)
        png = path.read_bytes() if draw.is_fine else None
        truth = (stored.read(tuple(names)), stored.labels) if names else ({}, None)
        return LiveFrame(self.camera.model, base_from_optical, base, frame.pixels, png, *truth)

    def files(self, draw: Draw) -> dict[str, bytes]:
        """Contents of the camera's files at a step, by file name."""
        stem = self._run.stem(self._camera_name, min(draw.state.step, self.steps - 1))
        return {path.name: path.read_bytes() for path in sorted(stem.parent.glob(f"{stem.name}.*"))}

    def statistics(self, draw: Draw) -> dict[str, Any]:
        """None, as nothing is drawn.

        Raises:
            RunError: always.
        """
        raise RunError("triangles are not counted in the images of a recorded run")

    def command(self, state: PageState, frame: LiveFrame) -> str:
        """Name of the image's file, as a shell comment."""
        return f"# {self._image(min(state.step, self.steps - 1))}"

    def about(self) -> dict[str, Any]:
        """Title, steps and driven path of the run."""
        path: list[list[float]] = []
        if self._run.has(GROUND_TRUTH):
            truth: Floats = read_trajectory(self._run.path / GROUND_TRUTH).positions_m
            path = np.round(truth[:, :2], 3).tolist()
        return {
            "scene": self.scene.name,
            "robot": self._run.manifest.title,
            "outline_m": None,
            "steps": self.steps,
            "driven_m": path,
            "has_clock": False,
            "is_editable": False,
        }

    def close(self) -> None:
        """Free the GPU memory."""
        self.stage.close()

    def _image(self, step: int) -> Path:
        return self._run.file(self._camera_name, step, ".png")
