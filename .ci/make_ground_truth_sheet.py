"""Contact sheet of all channels of ground truth.

`python .ci/make_ground_truth_sheet.py FILE`, with FILE a .png or .jpg.

The robot on the soccer field, through its mirror, and some of the channels through a fisheye lens
that looks ahead. The robot moves ahead and to the left: flow leads to the pose after this one, and
backward flow to the pose before.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import EquidistantCamera
from omnisim.core import poses
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.previews import preview
from omnisim.plots.contact_sheet import save_contact_sheet
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, load_scene
from omnisim.scene.model import Material

SIDE_PX, COLUMNS = 300, 4
BASE = poses.pose((-0.9, 0.6, 0.0), yaw_deg=35.0)
PREVIOUS_BASE = poses.pose((-1.0, 0.5, 0.0), yaw_deg=29.0)
NEXT_BASE = poses.pose((-0.8, 0.7, 0.0), yaw_deg=41.0)
LENS_THETA_MAX_DEG = 95.0
# For the tiles of materials: soccer has neither metal, mirrors nor emissive surfaces.
GLOWING, METALLIC = ("lamp_glow", "screens", "outside"), 0.8
MIRROR = "wall_east"
LENS_CHANNELS = ("range", "range_through", "normals", "semantic", "semantic_through")
Tile = tuple[str, NDArray[np.uint8]]


def ground_truth_tiles() -> list[Tile]:
    """Titles and images of the sheet."""
    vehicle = Vehicle.load("p2at")
    mounted = vehicle.camera("omnicam")
    lens_theta_max = math.radians(LENS_THETA_MAX_DEG)
    middle = 0.5 * (SIDE_PX - 1)
    lens = EquidistantCamera(
        SIDE_PX, SIDE_PX, 0.5 * SIDE_PX / lens_theta_max, (middle, middle), lens_theta_max
    )
    ahead = OmniCamera(lens, polygons=None, base_from_rig=mounted.sensor.base_from_rig)
    assert vehicle.body is not None
    body = _with_materials(vehicle.body, lambda one: dataclasses.replace(one, metallic=METALLIC))
    with Stage(_with_materials(load_scene("soccer"), _glowing), body) as stage:
        mirror = mounted.sensor.with_polygons(None).resized(SIDE_PX)
        tiles = _tiles(stage, mirror, mounted.hides, tuple(CHANNELS), "")
        return tiles + _tiles(stage, ahead, mounted.hides, LENS_CHANNELS, "fisheye: ")


def _glowing(material: Material) -> Material:
    """Material that emits its own color, or is a mirror, by its name; else the same material."""
    if material.name == MIRROR:
        return dataclasses.replace(
            material, base_color=(0.9, 0.9, 0.9, 1.0), texture=None, metallic=1.0, roughness=0.0
        )
    if material.name not in GLOWING:
        return material
    red, green, blue, _ = material.base_color
    return dataclasses.replace(
        material, emissive=(red, green, blue), emissive_map=material.texture, unlit=False
    )


def _with_materials(scene: Scene, change: Callable[[Material], Material]) -> Scene:
    """Scene with changed materials."""
    return dataclasses.replace(
        scene,
        materials=tuple(change(one) for one in scene.materials),
        lighting=dataclasses.replace(scene.lighting, is_matte=False),
    )


def _tiles(
    stage: Stage, sensor: OmniCamera, hidden: Collection[str], names: tuple[str, ...], prefix: str
) -> list[Tile]:
    with stage.open(sensor, hidden=hidden) as renderer:
        frame = renderer.render(
            BASE, also=names, next_state=NEXT_BASE, previous_state=PREVIOUS_BASE
        )
    channels = {
        name: preview(name, values, frame.labels) for name, values in frame.channels.items()
    }
    images = {"image": frame.rgb, **channels}
    return [(f"{prefix}{name}", image) for name, image in images.items()]


if __name__ == "__main__":
    save_contact_sheet(Path(sys.argv[1]), ground_truth_tiles(), COLUMNS)
