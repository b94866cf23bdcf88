"""Calibration file of a camera in a run's folder: its parameters and its mount on the base."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from omnisim.core.errors import OmnisimError, RunError
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
