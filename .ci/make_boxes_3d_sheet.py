"""Sheet of 3-D boxes over images.

`python .ci/make_boxes_3d_sheet.py FILE`, with FILE a .png or .jpg.

A robot in the soccer hall through a fisheye lens and a mirror: boxes of whole instances, and of
their visible points. Edges that are straight in the world are curved in the image.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, EquidistantCamera
from omnisim.core import poses
from omnisim.ground_truth.boxes import InstanceBox, OrientedBox
from omnisim.ground_truth.label_names import distinct_color
from omnisim.plots.contact_sheet import save_contact_sheet
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import load_scene

SIDE_PX, COLUMNS = 480, 2
BASE = poses.pose((-0.9, 0.6, 0.0), yaw_deg=35.0)
LENS_THETA_MAX_DEG = 95.0
MIN_PIXELS, MAX_SIZE_M = 40, 3.0  # boxes of a hall's walls and floor would surround everything
POINTS_PER_EDGE = 400
EDGES = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]
Tile = tuple[str, NDArray[np.uint8]]


def boxes_3d_tiles() -> list[Tile]:
    """Titles and images of the sheet."""
    vehicle = Vehicle.load("p2at")
    mounted = vehicle.camera("omnicam")
    theta_max = math.radians(LENS_THETA_MAX_DEG)
    middle = 0.5 * (SIDE_PX - 1)
    lens = EquidistantCamera(
        SIDE_PX, SIDE_PX, 0.5 * SIDE_PX / theta_max, (middle, middle), theta_max
    )
    sensors = {
        "fisheye": OmniCamera(lens, polygons=None, base_from_rig=mounted.sensor.base_from_rig),
        "mirror": mounted.sensor.with_polygons(None).resized(SIDE_PX),
    }
    tiles = []
    with Stage(load_scene("soccer"), vehicle.body) as stage:
        for name, sensor in sensors.items():
            with stage.open(sensor, hidden=mounted.hides) as renderer:
                frame = renderer.render(BASE, boxes_3d=True)
            shown = [one for one in frame.boxes_3d or () if _is_shown(one)]
            for kind in ("full", "visible"):
                drawn = ((getattr(one, kind), one.label.class_id) for one in shown)
                world_from_optical = np.array(frame.metadata["world_from_optical"])
                image = draw_boxes(frame.rgb, sensor.model, world_from_optical, drawn)
                tiles.append((f"{name}: {kind}", image))
    return tiles


def draw_boxes(
    image: NDArray[np.uint8],
    camera: CentralCamera,
    world_from_optical: NDArray[np.float64],
    boxes: Iterable[tuple[OrientedBox, int]],
) -> NDArray[np.uint8]:
    """Darkened copy of an image with the edges of boxes, each in the color of its number.

    Args:
        image: (height, width, 3) image of the camera.
        camera: camera model.
        world_from_optical: (4, 4) pose of the camera.
        boxes: boxes in the world frame, each with a number.
    """
    drawn = (0.7 * image).astype(np.uint8)
    share = np.linspace(0.0, 1.0, POINTS_PER_EDGE)[:, None]
    for box, number in boxes:
        corners_m = (box.corners_m - world_from_optical[:3, 3]) @ world_from_optical[:3, :3]
        for start, end in EDGES:
            points_m = corners_m[start] + share * (corners_m[end] - corners_m[start])
            pixels = camera.pixel_from_ray(points_m)
            columns, rows = np.rint(pixels.positions_px[pixels.valid]).astype(int).T
            inside = (columns >= 0) & (columns < camera.width_px)
            inside &= (rows >= 0) & (rows < camera.height_px)
            drawn[rows[inside], columns[inside]] = distinct_color(number)
    return drawn


def _is_shown(box: InstanceBox) -> bool:
    return box.pixels >= MIN_PIXELS and float(box.full.size_m.max()) <= MAX_SIZE_M


if __name__ == "__main__":
    save_contact_sheet(Path(sys.argv[1]), boxes_3d_tiles(), COLUMNS)
