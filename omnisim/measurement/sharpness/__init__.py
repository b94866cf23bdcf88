"""Sharpness and lateral color of a camera, from slanted edges (ISO 12233)."""

from omnisim.measurement.sharpness.measured_sharpness import MeasuredSharpness, measure_sharpness
from omnisim.measurement.sharpness.slanted_edge import (
    EdgeSharpness,
    find_edge_images,
    read_edge_image,
)

__all__ = [
    "EdgeSharpness", "MeasuredSharpness", "find_edge_images", "measure_sharpness",
    "read_edge_image",
]  # fmt: skip
