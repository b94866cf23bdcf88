"""Rig of a COLMAP reconstruction: `rigs` and `frames`, as text and in binary files.

All cameras are on one rig, whose frame is the first camera's. A frame is a step of the run; its
images are numbered as in `images`: step by step, camera by camera.

Source: COLMAP's documentation, "Rigs" and "Output Format"; its reconstruction_io.cc.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import quaternion_from_rotation

RIG_ID, REFERENCE_ID, CAMERA_SENSOR = 1, 1, 0


def rigid(pose: NDArray[np.float64]) -> list[float]:
    """Quaternion, w first, and translation of a pose (4, 4)."""
    x, y, z, w = quaternion_from_rotation(pose[None, :3, :3])[0].tolist()
    return [w, x, y, z, *pose[:3, 3].tolist()]


def write_rig_text(
    folder: Path, lens_from_rig: list[NDArray[np.float64]], rig_from_world: NDArray[np.float64]
) -> None:
    """Write rigs.txt and frames.txt.

    Args:
        folder: folder of the model.
        lens_from_rig: (4, 4) for each camera.
        rig_from_world: (steps, 4, 4) pose of the world in the rig's frame at each step.
    """
    sensors = f"{RIG_ID} {len(lens_from_rig)} CAMERA {REFERENCE_ID}"
    for camera_id, pose in enumerate(lens_from_rig[1:], start=2):
        sensors += f" CAMERA {camera_id} 1 {' '.join(map(repr, rigid(pose)))}"
    with (folder / "rigs.txt").open("w", encoding="utf-8") as file:
        file.write(f"# RIG_ID NUM_SENSORS REF_SENSOR SENSORS[]\n{sensors}\n")
    with (folder / "frames.txt").open("w", encoding="utf-8") as file:
        file.write("# FRAME_ID RIG_ID RIG_FROM_WORLD NUM_DATA_IDS DATA_IDS[]\n")
        for step, pose in enumerate(rig_from_world):
            numbers = " ".join(map(repr, rigid(pose)))
            data = " ".join(
                f"CAMERA {camera} {image}" for camera, image in _images(step, lens_from_rig)
            )
            file.write(f"{step + 1} {RIG_ID} {numbers} {len(lens_from_rig)} {data}\n")


def write_rig_binary(
    folder: Path, lens_from_rig: list[NDArray[np.float64]], rig_from_world: NDArray[np.float64]
) -> None:
    """Write rigs.bin and frames.bin; see `write_rig_text`."""
    with (folder / "rigs.bin").open("wb") as file:
        file.write(struct.pack("<QII", 1, RIG_ID, len(lens_from_rig)))
        file.write(struct.pack("<iI", CAMERA_SENSOR, REFERENCE_ID))
        for camera_id, pose in enumerate(lens_from_rig[1:], start=2):
            file.write(struct.pack("<iIB7d", CAMERA_SENSOR, camera_id, 1, *rigid(pose)))
    with (folder / "frames.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(rig_from_world)))
        for step, pose in enumerate(rig_from_world):
            file.write(struct.pack("<II7dI", step + 1, RIG_ID, *rigid(pose), len(lens_from_rig)))
            for camera, image in _images(step, lens_from_rig):
                file.write(struct.pack("<iIQ", CAMERA_SENSOR, camera, image))


def _images(step: int, cameras: list[NDArray[np.float64]]) -> list[tuple[int, int]]:
    """Numbers of the cameras and of their images at a step."""
    return [(camera, step * len(cameras) + camera) for camera in range(1, len(cameras) + 1)]
