"""Sensor file of a camera, as text."""

from __future__ import annotations

import math

import numpy as np

from omnisim.cameras import HyperbolicCamera, NonCentralCamera
from omnisim.core.files.toml_file import toml_keys, toml_tables
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera, Polygons


def sensor_toml(sensor: OmniCamera) -> str:
    """Write the sensor file of a camera, mounting included, with every key."""
    x, y, z = (float(value) for value in sensor.base_from_rig[:3, 3])
    angles = np.degrees(roll_pitch_yaw_from_rotation(sensor.base_from_rig[:3, :3]))
    # 1e-12°: what the way through radians leaves behind is not worth printing
    roll, pitch, yaw = (round(float(angle), 12) + 0.0 for angle in angles)
    parts = ""
    size = '"auto"' if sensor.face_size_px is None else sensor.face_size_px
    if isinstance(sensor.model, HyperbolicCamera):
        group, geometry = "mirror", _mirror(sensor.model, sensor.polygons)
        image = _image(sensor.model)
    elif isinstance(sensor.model, NonCentralCamera):
        group, image = "optics", ""
        named = sensor.model.parameters()
        own = {key: named[key] for key in named if key != "model"}
        geometry, parts = toml_tables(own, "optics.")
        geometry += _polygons(sensor.polygons)
    else:
        group, geometry, image = "lens", toml_keys(sensor.model.parameters()), ""
    return f"""[{group}]
{geometry}
[{group}.mounting]
position_m = [{x!r}, {y!r}, {z!r}]
roll_deg = {roll!r}
pitch_deg = {pitch!r}
yaw_deg = {yaw!r}
{parts}
[virtual_cameras]
size_px = {size}
texels_per_pixel = {sensor.texels_per_pixel!r}
near_m = {sensor.near_m!r}
far_m = {float(sensor.far_m)!r}
samples = {sensor.samples}

[camera]
{image}supersampling = {sensor.supersampling}
{_degradation(sensor)}"""


def _mirror(camera: HyperbolicCamera, polygons: Polygons) -> str:
    mirror = camera.mirror
    return f"""shape = "hyperbolic"
k = {mirror.k!r}
c = {mirror.c!r}
meters_per_unit = {mirror.meters_per_unit!r}
theta_max_deg = {round(math.degrees(mirror.theta_max_rad), 12)!r}
{_polygons(polygons)}"""


def _polygons(polygons: Polygons) -> str:
    return toml_keys({"polygons": "exact" if polygons is None else polygons})


def _image(camera: HyperbolicCamera) -> str:
    u, v = (float(value) for value in camera.principal_point_px)
    return f"""width_px = {camera.width_px}
height_px = {camera.height_px}
focal_length_px = {camera.focal_length_px!r}
principal_point_px = [{u!r}, {v!r}]
"""


def _degradation(sensor: OmniCamera) -> str:
    """Tables of the degradations, none for an ideal camera."""
    return "".join(
        f"\n[degradation.{name}]\n{toml_keys(values)}"
        for name, values in sensor.degradation.tables().items()
    )
