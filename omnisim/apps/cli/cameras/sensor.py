"""`omnisim sensor`."""

from __future__ import annotations

import math
from collections.abc import Iterator

from omnisim.apps.cli.cameras.requests import SensorRequest
from omnisim.apps.cli.console import out
from omnisim.cameras import HyperbolicCamera, NonCentralCamera
from omnisim.cameras.camera import ParameterValue
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE

MAX_VALUES = 8  # maximum list length that is printed in full


def run(request: SensorRequest) -> None:
    """Print the default sensor file, or check one and summarize it."""
    if request.check is None:
        out.print(DEFAULT_SENSOR_FILE.read_text(encoding="utf-8"), end="")
        return
    sensor = OmniCamera.from_file(request.check)
    out.print(f"{request.check}: valid")
    named = sensor.model.parameters().items()
    lines = [f"  {key:22} {value}" for key, value in named]
    if isinstance(sensor.model, HyperbolicCamera):
        camera, mirror = sensor.model, sensor.model.mirror
        lines = [
            f"  mirror   k = {mirror.k:g}, c = {mirror.c:g} ({1000.0 * mirror.c_m:.4g} mm), "
            f"e = {mirror.eccentricity:.7g}, ξ = {mirror.xi:.7g}",
            f"  rim      {math.degrees(mirror.theta_max_rad):.4g}°, "
            f"radius {1000.0 * mirror.rim_radius_m:.4g} mm",
            f"  mesh     {mesh_text(sensor)}",
            f"  image  {camera.width_px} × {camera.height_px} px, "
            f"focal length {camera.focal_length_px:.6g} px, "
            f"90° circle {camera.horizon_radius_px:.6g} px, rim {camera.rim_radius_px:.6g} px",
        ]
    elif isinstance(sensor.model, NonCentralCamera):
        lines = [line for key, value in named for line in _part_lines(key, value)]
    for name, values in sensor.degradation.tables().items():
        pairs = ", ".join(f"{key} = {value}" for key, value in values.items())
        lines.append(f"  {name:22} {pairs}")
    for line in lines:
        out.print(line)


def _part_lines(key: str, value: ParameterValue) -> Iterator[str]:
    """Lines for a key of an optical system, one per part; a long list only by its length."""
    for part in value if isinstance(value, list) and isinstance(value[0], dict) else [value]:
        if not isinstance(part, dict):
            yield f"  {key:22} {part}"
            continue
        texts = []
        for name, entry in part.items():
            is_long = isinstance(entry, list) and len(entry) > MAX_VALUES
            texts.append(f"{name} = {f'{len(entry)} values' if is_long else entry}")
        yield f"  {key:22} {', '.join(texts)}"


def mesh_text(sensor: OmniCamera) -> str:
    """Summarize a mirror mesh: its polygons, and its maximum error rounded up."""
    if sensor.mesh_polygons is None:
        return f"{sensor.mesh_summary}, none"
    error_px = math.ceil(1000.0 * sensor.mesh_error_px) / 1000.0
    return f"{sensor.mesh_summary}, off by {error_px:g} px at most"
