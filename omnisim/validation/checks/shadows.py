"""Direct light with shadows: our pictures of lit scenes against a path tracer's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.plots.plot_file import Figure
from omnisim.plots.style import gallery
from omnisim.reports.measure import Measure
from omnisim.reports.report import CaptionedFigure, Section
from omnisim.scene import load_scene
from omnisim.sensors import Renderer
from omnisim.validation.fixture import Fixture, linear_picture, mirror_camera
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides
from omnisim.validation.psnr import psnr_db
from omnisim.validation.traced_mirror import beside, inside_mirror, small_mirror, traced_in_mirror

FOLDER = Path(__file__).parents[1] / "lit"
SCENES, QUICK_SCENES = ("soccer", "courtyard"), ("soccer",)
SIZE_PX, QUICK_SIZE_PX = 160, 128
SAMPLES, QUICK_SAMPLES = 144, 36  # squares, as its sampler wants
BOUND_DB = 34.0


def check(fixture: Fixture, title: str) -> Section:
    """Trace scenes lit by lamps inside them in a real mirror, and compare."""
    measures: list[Measure] = []
    pictures: dict[str, NDArray[np.generic]] = {}
    size_px = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    samples = QUICK_SAMPLES if fixture.is_quick else SAMPLES
    for name in QUICK_SCENES if fixture.is_quick else SCENES:
        scene = matte_on_both_sides(load_scene(FOLDER / f"{name}.toml"))
        sensor = small_mirror(size_px)
        pose = sensor.base_pose(scene.start.position_m, yaw_deg=20.0)
        traced = traced_in_mirror(scene, sensor, pose, samples)
        inside = inside_mirror(mirror_camera(sensor))
        with Renderer(scene, sensor, device=fixture.device) as renderer:
            ours = linear_picture(renderer.render(pose, linear=True))
        found_db = psnr_db(traced, ours, inside)
        measures.append(
            Measure(f"{name}, default quality", found_db, "dB", BOUND_DB, at_least=True)
        )
        pictures |= beside(name, traced, ours, inside)
    measures += [Measure("size", size_px, "px"), Measure("samples per pixel", samples)]
    return Section(
        title,
        f"Mitsuba's path tracer follows {samples} rays a pixel from a real mirror to diffuse "
        "surfaces, and from each to every lamp: direct light with hard shadows. The scenes are "
        "built-in ones, lit by lamps inside them and by the sun: `omnisim/validation/lit`, with "
        "exposures of 0.001 and 0.00001 for a lux.",
        tuple(measures),
        figures=(
            CaptionedFigure(
                "lit-scenes",
                _figure(pictures),
                "Lit scenes in a traced mirror, our pictures, and their difference, eight times "
                "enhanced.",
            ),
        ),
    )


def _figure(pictures: dict[str, NDArray[np.generic]]) -> Figure:
    return gallery(pictures, 3, side_in=4.2)
