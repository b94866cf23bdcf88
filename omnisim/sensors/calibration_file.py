"""Calibration file and images of a camera in the folder of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Bytes
from omnisim.core.errors import OmnisimError, RunError
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import check_pose
from omnisim.perception.unwarping import CameraMount
from omnisim.rendering.camera.captured_image import camera_of_parameters, valid_mask
from omnisim.rendering.camera.quality import MAX_IMAGE_PX


def read_mount(path: Path) -> CameraMount:
    """Read the camera and its mount from a calibration file.

    Raises:
        RunError: the file cannot be read or is damaged.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except (ValueError, RecursionError):
        raise RunError(f"{path}: is damaged: not a camera's calibration") from None
    return parse_mount(content, path)


def parse_mount(content: Any, place: str | Path) -> CameraMount:
    """Parse the content of a calibration file.

    Raises:
        RunError: the content is damaged.
    """
    try:
        camera = camera_of_parameters(content["camera"])
        if max(camera.width_px, camera.height_px) > MAX_IMAGE_PX:
            raise OmnisimError(f"camera: size: expected at most {MAX_IMAGE_PX} px per side")
        base_from_optical = check_pose(content["base_from_optical"])
        polygons = content["polygons"] if isinstance(content["polygons"], int) else None
        return CameraMount(camera, base_from_optical, valid_mask(camera, polygons))
    except OmnisimError as reason:
        raise RunError(f"{place}: {reason}") from None
    except (KeyError, TypeError, ValueError, RecursionError):
        raise RunError(f"{place}: is damaged: not a camera's calibration") from None


def read_colors(path: Path, camera: CentralCamera) -> Bytes:
    """Read an image (height, width, 3) of a camera, sRGB.

    Raises:
        OutputError: the image is damaged.
        RunError: the image is of another size, or without 8 bits and 3 colors.
    """
    pixels, _ = read_image(path)
    height, width, channels = pixels.shape
    expected = (camera.height_px, camera.width_px)
    if (height, width) != expected or channels < 3 or pixels.dtype != np.uint8:
        raise RunError(
            f"{path}: has {width} × {height} px of {channels} × {pixels.dtype}: expected this "
            f"camera's {camera.width_px} × {camera.height_px} px of 3 × uint8"
        )
    return np.ascontiguousarray(pixels[..., :3])
