"""Sensor file of a camera, as TOML text."""

from __future__ import annotations

from typing import Any

import numpy as np

from omnisim.cameras import HyperbolicCamera, NonCentralCamera
from omnisim.core.files.toml_file import toml_text
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera


def sensor_toml(sensor: OmniCamera) -> str:
    """Sensor file of a camera with every key, mounting included."""
    angles = np.degrees(roll_pitch_yaw_from_rotation(sensor.base_from_rig[:3, :3]))
    # 1e-12°: hides the rounding of the conversion through radians
    roll, pitch, yaw = (round(float(angle), 12) + 0.0 for angle in angles)
    polygons = "exact" if sensor.polygons is None else sensor.polygons
    image: dict[str, Any] = {}
    written, changed = sensor.capture.to_table(full=True), sensor.capture.to_table()
    if isinstance(sensor.model, HyperbolicCamera):
        group, geometry = (
            "mirror",
            {"shape": "hyperbolic", **sensor.model.mirror.to_table(full=True)},
        )
        geometry |= {"polygons": polygons, "theta_max_deg": round(geometry["theta_max_deg"], 12)}
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
                **{key: written[key] for key in ("texels_per_pixel", "near_m", "far_m", "samples")},
                **{key: changed.get(key) for key in ("mirrors", "reflection_probes")},
            },
            "camera": {**image, "supersampling": sensor.supersampling},
            "degradation": sensor.degradation.tables() or None,
        }
    )


def _image(camera: HyperbolicCamera) -> dict[str, Any]:
    u, v = (float(value) for value in camera.principal_point_px)
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "focal_length_px": camera.focal_length_px,
        "principal_point_px": [u, v],
    }
