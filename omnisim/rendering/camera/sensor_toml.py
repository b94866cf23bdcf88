"""Sensor file of a camera, as TOML text."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from omnisim.cameras import HyperbolicCamera, NonCentralCamera
from omnisim.core.files.toml_file import toml_text
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import DEFAULT_MIRRORS, DEFAULT_PROBES


def sensor_toml(sensor: OmniCamera) -> str:
    """Sensor file of a camera with every key, mounting included."""
    angles = np.degrees(roll_pitch_yaw_from_rotation(sensor.base_from_rig[:3, :3]))
    # 1e-12°: hides the rounding of the conversion through radians
    roll, pitch, yaw = (round(float(angle), 12) + 0.0 for angle in angles)
    polygons = "exact" if sensor.polygons is None else sensor.polygons
    image: dict[str, Any] = {}
    if isinstance(sensor.model, HyperbolicCamera):
        group, geometry = "mirror", {**_mirror(sensor.model), "polygons": polygons}
        image = _image(sensor.model)
    elif isinstance(sensor.model, NonCentralCamera):
        group, geometry = "optics", {**sensor.model.parameters(), "polygons": polygons}
        geometry.pop("model", None)
    else:
        group, geometry = "lens", dict(sensor.model.parameters())
    mounting = {
        "position_m": sensor.base_from_rig[:3, 3].tolist(),
        "roll_deg": roll,
        "pitch_deg": pitch,
        "yaw_deg": yaw,
    }
    return toml_text(
        {
            group: {"mounting": mounting, **geometry},
            "virtual_cameras": {
                "size_px": "auto" if sensor.face_size_px is None else sensor.face_size_px,
                "texels_per_pixel": sensor.texels_per_pixel,
                "near_m": sensor.near_m,
                "far_m": float(sensor.far_m),
                "samples": sensor.samples,
                "mirrors": None if sensor.mirrors == DEFAULT_MIRRORS else sensor.mirrors,
                "reflection_probes": (
                    None if sensor.reflection_probes == DEFAULT_PROBES else sensor.reflection_probes
                ),
            },
            "camera": {**image, "supersampling": sensor.supersampling},
            "degradation": sensor.degradation.tables() or None,
        }
    )


def _mirror(camera: HyperbolicCamera) -> dict[str, Any]:
    mirror = camera.mirror
    return {
        "shape": "hyperbolic",
        "k": mirror.k,
        "c": mirror.c,
        "meters_per_unit": mirror.meters_per_unit,
        "theta_max_deg": round(math.degrees(mirror.theta_max_rad), 12),
    }


def _image(camera: HyperbolicCamera) -> dict[str, Any]:
    u, v = (float(value) for value in camera.principal_point_px)
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "focal_length_px": camera.focal_length_px,
        "principal_point_px": [u, v],
    }
