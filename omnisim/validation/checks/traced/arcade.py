"""A scene of glass, mirrors, metal and polished stone against a path tracer.

omnisim's image is compared with Mitsuba's converged one, estimated from two images with independent
noise (`converged_psnr_db`).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from omnisim.plots.style import gallery
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import load_scene
from omnisim.validation import traced_light as traced
from omnisim.validation.fixture import BACKENDS, Fixture, linear_image
from omnisim.validation.image_differences import converged_psnr_db, noise_floor_db

SCENE = "arcade"
# The quick check has the mirror alone: at 48 px the fisheye's pixels hold whole signs and shops.
SIZE_PX, QUICK_SIZE_PX = 96, 48
# Squares, as Mitsuba's sampler requires, by camera: a texel of the fisheye is 1/16 of a pixel.
SAMPLES = {"mirror": 1024, "fisheye": 36}
SUPERSAMPLING = 8  # omnisim: 64 samples per pixel, as chips of stone are smaller than pixels
BOUND_DB = 32.0
_YAW_DEG = 20.0


def check(fixture: Fixture, title: str) -> Section:
    """Render the arcade with both back ends and with Mitsuba, and compare."""
    measures: list[Measure] = []
    images: dict[str, NDArray[np.generic]] = {}
    size_px = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    scene = load_scene(SCENE)
    for camera in traced.CAMERAS[:1] if fixture.is_quick else traced.CAMERAS:
        sensor = traced.sensor_of(camera, size_px)
        inside = traced.inside_rim(sensor)
        pose = sensor.base_pose(scene.start.position_m, yaw_deg=_YAW_DEG)
        first, second = traced.traced_twice(scene, sensor, pose, SAMPLES[camera])
        fine = dataclasses.replace(sensor, supersampling=SUPERSAMPLING)
        rays, cube = (
            linear_image(fixture.render(scene, fine, pose, unlit=False, backend=backend))
            for backend in BACKENDS
        )
        rays_db, cube_db = (converged_psnr_db(x, first, second, inside) for x in (rays, cube))
        floor_db = noise_floor_db(first, second, inside)
        measures += [
            Measure(f"{camera}, back end rays", rays_db, "dB", BOUND_DB, at_least=True),
            Measure(f"{camera}, back end cube", cube_db, "dB"),
            Measure(f"{camera}: one of Mitsuba's images against the converged one", floor_db, "dB"),
        ]
        mean = (0.5 * (first + second)).astype(np.float32)
        images |= traced.beside(f"{camera}, rays", mean, rays, inside)
        images |= traced.beside(f"{camera}, cube", mean, cube, inside)
    measures += [Measure("size", size_px, "px"), *traced.samples_of(SAMPLES)]
    return Section(
        title,
        "The built-in scene `arcade` with its bake: panes, mirrors, a glossy floor, chrome "
        "and brushed metal, frosted and thick glass. Mitsuba traces all light, from a real mirror, "
        "or from the faces of a cube for the fisheye. The PSNR is that to Mitsuba's converged "
        "image, from two images with independent noise. Mitsuba's gloss takes no light from the "
        "color below.",
        measures,
        figures=[CaptionedFigure("arcade", gallery(images, 6, side_in=2.7),
                 "The arcade traced by Mitsuba, by both back ends of omnisim, and their difference "
                 "× 8.")],
    )  # fmt: skip
