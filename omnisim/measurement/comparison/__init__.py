"""Comparison of a camera's images with those of its twin: boards or scenes from the same poses."""

from omnisim.measurement.comparison.comparison import (
    Comparison,
    ImageComparison,
    compare_images,
    pose_indices,
)
from omnisim.measurement.comparison.scene_comparison import compare_scene, compare_scene_images
from omnisim.measurement.geometry.placed_board import BoardSurface, locate_board

__all__ = [
    "BoardSurface", "Comparison", "ImageComparison", "compare_images", "compare_scene",
    "compare_scene_images", "locate_board", "pose_indices",
]  # fmt: skip
