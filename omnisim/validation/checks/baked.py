"""Baked light: our pictures of lit scenes against a path tracer's, with all bounces."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.baking.baked_files import bake_scene
from omnisim.baking.settings import BakeSettings
from omnisim.plots.style import gallery
from omnisim.reports.measure import Measure
from omnisim.reports.report import CaptionedFigure, Section
from omnisim.scene import load_scene
from omnisim.scene.baked import with_baked_light
from omnisim.sensors import Renderer
from omnisim.validation.checks.shadows import FOLDER, QUICK_SCENES, SCENES
from omnisim.validation.fixture import Fixture, linear_picture, mirror_camera
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides
from omnisim.validation.psnr import psnr_db
from omnisim.validation.ssim import ssim
from omnisim.validation.traced_mirror import beside, inside_mirror, small_mirror, traced_in_mirror

SIZE_PX, QUICK_SIZE_PX = 128, 96
SAMPLES, QUICK_SAMPLES = 400, 256  # squares, as its sampler wants
SETTINGS = BakeSettings(samples=32)
QUICK_SETTINGS = BakeSettings(texel_m=0.1, samples=32)
BOUND_DB, BOUND_SSIM = 32.0, 0.95


def check(fixture: Fixture, title: str) -> Section:
    """Bake scenes lit by lamps inside them, trace them in a real mirror, and compare."""
    measures: list[Measure] = []
    pictures: dict[str, NDArray[np.generic]] = {}
    size_px = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    samples = QUICK_SAMPLES if fixture.is_quick else SAMPLES
    settings = QUICK_SETTINGS if fixture.is_quick else SETTINGS
    for name in QUICK_SCENES if fixture.is_quick else SCENES:
        scene = matte_on_both_sides(load_scene(FOLDER / f"{name}.toml"))
        sensor = small_mirror(size_px)
        pose = sensor.base_pose(scene.start.position_m, yaw_deg=20.0)
        inside = inside_mirror(mirror_camera(sensor))
        traced = traced_in_mirror(scene, sensor, pose, samples, bounces=True)
        with tempfile.TemporaryDirectory(prefix="omnisim-baked-") as folder:
            baked = Path(folder) / "scene.baked"
            bake_scene(scene, baked, settings)
            lit = with_baked_light(scene, baked)
        with Renderer(lit, sensor, device=fixture.device) as renderer:
            ours = linear_picture(renderer.render(pose, linear=True))
        found_db, found_ssim = psnr_db(traced, ours, inside), ssim(traced, ours, inside)
        measures += [
            Measure(f"{name}, baked", found_db, "dB", BOUND_DB, at_least=True),
            Measure(f"{name}, structural similarity", found_ssim, "", BOUND_SSIM, at_least=True),
        ]
        pictures |= beside(name, traced, ours, inside)
    measures += [
        Measure("size", size_px, "px"),
        Measure("samples per pixel", samples),
        Measure("rays from a texel", settings.samples),
    ]
    return Section(
        title,
        f"Mitsuba's path tracer follows {samples} rays a pixel from a real mirror through all "
        "their bounces off diffuse surfaces to the lamps. Ours are pictures of the same scenes "
        "with light that `omnisim bake` has computed: the lit scenes of the check of shadows.",
        tuple(measures),
        figures=(
            CaptionedFigure(
                "baked-scenes",
                gallery(pictures, 3, side_in=4.2),
                "Lit scenes in a traced mirror, our pictures in baked light, and their difference, "
                "eight times enhanced.",
            ),
        ),
    )
