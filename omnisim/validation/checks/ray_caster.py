"""A ray caster: images and ground truth of the virtual cameras against Embree's rays.

The geometry is Embree's, and appearance is recomputed in NumPy: the back ends share only the camera
models, the mip levels of textures, and the degradation, which is left out here.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from omnisim.cameras import EquidistantCamera
from omnisim.core.arrays import Bytes
from omnisim.ground_truth.frame import Frame
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation.fixture import TEXTURED_SCENE, Fixture
from omnisim.validation.image_differences import psnr_of_levels_db

SCENES = (TEXTURED_SCENE, "soccer", "mapping")
BOUND_DB = 36.0
# Shares of pixels, in the courtyard: a ray hits a leaf if its texture is opaque at that exact
# point, the cube if its texel shows the leaf.
BOUND_SAME_PERCENT = 97.5
SAME_RANGE = 1e-3  # share of the range within which hits are equal
_SHOWN_FACTOR = 4  # of differences in the figure


def check(fixture: Fixture, title: str) -> Section:
    """Render images with both back ends, and compare colors and visible surfaces."""
    images: dict[str, Bytes] = {}
    rows, worst_db, worst_percent = [], math.inf, math.inf
    fisheye = EquidistantCamera(360, 360, 100.0, (179.5, 179.5), math.radians(100.0))
    sensors = {"mirror": OmniCamera(), "fisheye": OmniCamera(fisheye)}
    for name in SCENES[:1] if fixture.is_quick else SCENES:
        scene = load_scene(name, baked="none", sky="none")
        # a single sample of a surface brighter than white would saturate its whole pixel
        materials = [
            dataclasses.replace(each, emissive=tuple(np.minimum(each.emissive, 1.0).tolist()))
            for each in scene.materials
        ]
        scene = dataclasses.replace(scene, materials=tuple(materials))
        for lens, sensor in sensors.items():
            cube = _frame(scene, sensor, "cube", fixture.device)
            rays = _frame(scene, sensor, "rays", None)
            seen = cube.valid & rays.valid
            decibels = psnr_of_levels_db(cube.rgb[seen], rays.rgb[seen])
            percent = 100.0 * _same_share(cube, rays)
            worst_db, worst_percent = min(worst_db, decibels), min(worst_percent, percent)
            rows.append((name, lens, f"{decibels:.1f}", f"{percent:.2f}"))
            if name == TEXTURED_SCENE:
                off = _SHOWN_FACTOR * np.abs(cube.rgb.astype(np.int16) - rays.rgb)
                images |= {
                    f"{lens}, cube": cube.rgb,
                    f"{lens}, rays": rays.rgb,
                    f"{lens}, difference": np.minimum(off, 255).astype(np.uint8),
                }
    return Section(
        title,
        "Images by virtual cameras against images by Embree's rays, with 3 × 3 samples per pixel, "
        "at default quality and in even light. A pixel shows the same surface if the ray of its "
        f"center has the same instance, and the same range within {100 * SAME_RANGE:g} %.",
        (
            Measure("worst image", worst_db, "dB", BOUND_DB, at_least=True),
            Measure("the same surface", worst_percent, "%", BOUND_SAME_PERCENT, at_least=True),
        ),
        tables=(ResultTable("PSNR in dB, and pixels of the same surface in %",
                            ("scene", "camera", "PSNR", "same surface"), tuple(rows)),),
        figures=[CaptionedFigure("rays", gallery(images, 3),
                 f"Images by both; differences are shown {_SHOWN_FACTOR} times as large.")],
    )  # fmt: skip


def _frame(scene: Scene, sensor: OmniCamera, backend: BackendName, device: int | None) -> Frame:
    base = sensor.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
    with open_sensor(scene, sensor, backend=backend, device=device) as renderer:
        return renderer.render(base, also=("range", "instance"))


def _same_share(cube: Frame, rays: Frame) -> float:
    """Share of pixels at which both frames show the same surface, among pixels with a ray."""
    assert cube.has_ray is not None
    cube_m, rays_m = cube.channels["range"], rays.channels["range"]
    same = cube.channels["instance"] == rays.channels["instance"]
    known = np.isfinite(cube_m) & np.isfinite(rays_m)
    differs = np.abs(np.where(known, cube_m, 0.0) - np.where(known, rays_m, 0.0))
    same &= differs <= SAME_RANGE * np.where(known, rays_m, 0.0)
    same &= np.isfinite(cube_m) == np.isfinite(rays_m)
    return float(np.mean(same[cube.has_ray]))
