"""Map of a scene from above: its floor plan, cut open above the floor, drawn by the renderer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.core.poses import pose_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.scene import Scene
from omnisim.scene.space.floor import floor_height_m

CUT_M = 0.95  # height of the cut above the ground, so that higher parts do not hide the floor
LONGER_SIDE_PX = 1000
REACH_M = 20.0  # extent around the viewpoint if the scene names no places
MARGIN_M = 6.0  # margin around the scene's named places
_WORLD_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0])  # looks down; the world's y is up in the image
DISTANCE = 30.0  # camera distance in units of the longer side: rays are nearly parallel


@dataclass(frozen=True, eq=False)
class FloorMap:
    """Image of a scene from above, x to the right and y up.

    Attributes:
        rgb: (height, width, 3) uint8 sRGB.
        low_m, high_m: (2,) minimum and maximum x and y of the image in the world.
        ground_m: height (z) of the ground in the world.
    """

    rgb: NDArray[np.uint8]
    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]
    ground_m: float


def draw_floor_map(stage: Stage, near_m: tuple[float, float, float]) -> FloorMap:
    """Draw the map of a stage's scene around the point `near_m`.

    Raises:
        OmnisimError: the GPU cannot render the map.
    """
    scene = stage.scene
    ground_m = ground_height_m(scene, near_m)
    low_m, high_m = _corners(scene, near_m)
    side_m = float((high_m - low_m).max())
    width_px, height_px = (
        max(1, round(float(side) / side_m * LONGER_SIDE_PX)) for side in high_m - low_m
    )
    distance_m = DISTANCE * side_m
    pixels_per_m = LONGER_SIDE_PX / side_m
    camera = PerspectiveCamera(
        width_px, height_px, distance_m * pixels_per_m,
        (0.5 * (width_px - 1), 0.5 * (height_px - 1)),
    )  # fmt: skip
    looking = _WORLD_FROM_OPTICAL @ camera.rig_from_optical.T
    sensor = OmniCamera(
        camera, polygons=None, near_m=distance_m - CUT_M, supersampling=2, texels_per_pixel=1.5
    )
    middle_m = 0.5 * (low_m + high_m)
    base = pose_from_rotation(looking, (*middle_m, ground_m + distance_m))
    hidden = {one.name for body in stage.vehicles.values() for one in body.instances}
    with stage.open(sensor, hidden=hidden) as renderer:
        frame = renderer.render(base)
    half_m = 0.5 * np.array((width_px, height_px)) / pixels_per_m
    return FloorMap(frame.rgb, middle_m - half_m, middle_m + half_m, ground_m)


def ground_height_m(scene: Scene, near_m: tuple[float, float, float]) -> float:
    """Height (z) of the floor below a viewpoint; without a floor, of the scene's lowest point."""
    floor_m = floor_height_m(scene, near_m[:2], near_m[2] - 0.5 * CUT_M)
    if floor_m is not None and math.isfinite(floor_m) and floor_m <= near_m[2]:
        return floor_m
    return float(min(scene.bounds_m()[0, 2], near_m[2]))


def _corners(
    scene: Scene, near_m: tuple[float, float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Minimum and maximum (x, y) of the map: around starts, landmarks, paths and the viewpoint.

    Around the viewpoint alone if the scene has none of these, or if they are far apart.
    """
    places = [one.position_m[:2] for one in scene.starts]
    places += [one.position_m[:2] for one in scene.landmarks]
    places += [point[:2] for path in scene.paths for point in path.waypoints_m]
    named = np.array([*places, near_m[:2]], dtype=np.float64)
    is_near = bool(places) and float(np.ptp(named, axis=0).max()) < 10.0 * REACH_M
    at, reach_m = (named, MARGIN_M) if is_near else (named[-1:], REACH_M)
    low, high = scene.bounds_m()[:, :2]
    low, high = np.minimum(low, near_m[:2]) - 0.3, np.maximum(high, near_m[:2]) + 0.3
    return np.maximum(low, at.min(axis=0) - reach_m), np.minimum(high, at.max(axis=0) + reach_m)
