"""Near plane of virtual cameras in scenes of all sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a sensor file is read without scenes
    from omnisim.scene import Scene

NEAR_PER_SIZE = 0.05  # near plane per longest side of the scene


def scene_size_m(scene: Scene) -> float:
    """Longest side of the static geometry, else of the moving objects; 0: empty."""
    if not scene.instances and not scene.objects:
        return 0.0
    low, high = scene.bounds_m()
    return float((high - low).max())


def near_plane_m(size_m: float, default_m: float) -> float:
    """Distance of the near plane for a scene size: the default, or less in small scenes.

    Reversed float depth is equally precise with any near plane.
    """
    near_m = NEAR_PER_SIZE * size_m
    return near_m if 0.0 < near_m < default_m else default_m
