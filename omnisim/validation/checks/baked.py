"""Baked light: our images of lit scenes against a path tracer's, with all bounces."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.plots.style import gallery
from omnisim.rendering.baking.baked_files import bake_scene
from omnisim.rendering.baking.settings import FINE_TEXELS, BakeSettings
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import load_scene
from omnisim.scene.light.baked import with_baked_light
from omnisim.scene.model import Scene
from omnisim.validation.checks.shadows import FOLDER, QUICK_SCENES, SCENES
from omnisim.validation.fixture import BACKENDS, Fixture, linear_image
from omnisim.validation.image_differences import converged_psnr_db, psnr_db, ssim
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides
from omnisim.validation.reflective_rooms import window_room
from omnisim.validation.traced_light import (
    CAMERAS,
    beside,
    inside_rim,
    samples_of,
    sensor_of,
    traced_light,
    traced_twice,
)

SIZE_PX, QUICK_SIZE_PX = 128, 96
# Squares, as Mitsuba's sampler requires, by camera: a texel of the fisheye is 1/16 of a pixel.
SAMPLES = {"mirror": 400, "fisheye": 16}
QUICK_SAMPLES = {"mirror": 256, "fisheye": 16}
SETTINGS = BakeSettings(samples=32, texels=FINE_TEXELS)
QUICK_SETTINGS = BakeSettings(texel_m=0.1, samples=32)
BOUND_DB, BOUND_SSIM = 32.0, 0.95
# Mitsuba finds little of the light behind a window: its noise is taken from the difference.
WINDOW_SIZE_PX, QUICK_WINDOW_SIZE_PX = 64, 48
WINDOW_SAMPLES = {"mirror": 576, "fisheye": 36}  # of each of two images
WINDOW_SETTINGS = BakeSettings(texel_m=0.06, samples=64)


def check(fixture: Fixture, title: str) -> Section:
    """Bake scenes lit by lamps, trace them in a real mirror and a fisheye, and compare."""
    measures: list[Measure] = []
    images: dict[str, NDArray[np.generic]] = {}
    size_px = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    samples = QUICK_SAMPLES if fixture.is_quick else SAMPLES
    settings = QUICK_SETTINGS if fixture.is_quick else SETTINGS
    for name in QUICK_SCENES if fixture.is_quick else SCENES:
        scene = matte_on_both_sides(load_scene(FOLDER / f"{name}.toml"))
        lit = in_baked_light(scene, settings)
        for camera in CAMERAS:
            sensor = sensor_of(camera, size_px)
            pose = sensor.base_pose(scene.start.position_m, yaw_deg=20.0)
            traced = traced_light(scene, sensor, pose, samples[camera], bounces=True)
            ours = linear_image(fixture.render(lit, sensor, pose, unlit=False))
            inside = inside_rim(sensor)
            label, level_db = f"{name}, {camera}", psnr_db(traced, ours, inside)
            likeness = ssim(traced, ours, inside)
            measures += [
                Measure(f"{label}: baked", level_db, "dB", BOUND_DB, at_least=True),
                Measure(f"{label}: structural similarity", likeness, "", BOUND_SSIM, at_least=True),
            ]
            images |= beside(label, traced, ours, inside)
    by_window, seen_by_window = _by_window(fixture)
    measures += [
        *by_window,
        Measure("size", size_px, "px"),
        *samples_of(samples),
        Measure("rays from a texel", settings.samples),
    ]
    return Section(
        title,
        "Images with light from `omnisim bake`, against Mitsuba's path tracer. Mitsuba traces rays "
        "from a real mirror, or from the faces of a cube for the fisheye, over all bounces off "
        "diffuse surfaces to the lamps. The scenes are the lit scenes of the check of shadows, and "
        "a room in the light of a window, a mirror and a lamp behind frosted glass, by both back "
        "ends.",
        measures,
        figures=[CaptionedFigure("baked-scenes", gallery(images | seen_by_window, 6, side_in=2.7),
                 "Lit scenes traced by Mitsuba in a mirror and through a fisheye, omnisim's images "
                 "in baked light, and their difference × 8.")],
    )  # fmt: skip


def _by_window(fixture: Fixture) -> tuple[list[Measure], dict[str, NDArray[np.generic]]]:
    """Measures and images of a room with a window, a mirror and frosted glass."""
    scene, measures = window_room(), list[Measure]()
    images: dict[str, NDArray[np.generic]] = {}
    lit = in_baked_light(scene, WINDOW_SETTINGS)
    for camera in CAMERAS:
        sensor = sensor_of(camera, QUICK_WINDOW_SIZE_PX if fixture.is_quick else WINDOW_SIZE_PX)
        pose = sensor.base_pose(scene.start.position_m, yaw_deg=20.0)
        first, second = traced_twice(scene, sensor, pose, WINDOW_SAMPLES[camera])
        inside = inside_rim(sensor)
        for backend in BACKENDS:
            frame = fixture.render(lit, sensor, pose, unlit=False, backend=backend)
            ours = linear_image(frame)
            value = converged_psnr_db(ours, first, second, inside)
            label = f"window, {camera}, back end {backend}: baked"
            measures.append(Measure(label, value, "dB", BOUND_DB, at_least=True))
        mean = (0.5 * (first + second)).astype(np.float32)
        images |= beside(f"window, {camera}", mean, ours, inside)
    return measures, images


def in_baked_light(scene: Scene, settings: BakeSettings) -> Scene:
    """Scene with its light baked, in a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="omnisim-baked-") as folder:
        baked = Path(folder) / "scene.baked"
        bake_scene(scene, baked, settings)
        return with_baked_light(scene, baked)
