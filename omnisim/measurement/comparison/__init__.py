"""Comparison of a camera's images with those of its twin: the same boards in the same poses."""

from omnisim.measurement.comparison.comparison import Comparison, ImageComparison, compare_images
from omnisim.measurement.geometry.placed_board import BoardSurface, locate_board

__all__ = ["BoardSurface", "Comparison", "ImageComparison", "compare_images", "locate_board"]
