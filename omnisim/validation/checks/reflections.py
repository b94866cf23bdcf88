"""Reflections of both back ends against Mitsuba's path tracer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Floats32
from omnisim.plots.style import gallery
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import Scene
from omnisim.validation import reflective_rooms
from omnisim.validation.fixture import BACKENDS, Fixture
from omnisim.validation.image_differences import psnr_db
from omnisim.validation.oracles.mirrored_beams import beam_measures
from omnisim.validation.traced_light import beside

WIDTH_PX, QUICK_WIDTH_PX = 240, 120
SUPERSAMPLING = 4  # omnisim: 16 samples per pixel, with 8 rays each on glossy surfaces
SAMPLES = 256  # Mitsuba: samples per pixel
MIN_DB = {
    "planar mirror": 36.0,
    "floor of roughness 0.1": 34.0,
    "floor of roughness 0.3": 34.0,
    "chrome ball": 32.0,
    "ball of roughness 0.3": 32.0,
    "thick glass ball": 32.0,
    "thin pane": 36.0,
}
BY_PROBES = ("chrome ball", "ball of roughness 0.3", "thick glass ball")  # by cube
MIN_BY_PROBES_DB = 28.0


def check(fixture: Fixture, title: str) -> Section:
    """Render each room with omnisim and Mitsuba, and compare the images."""
    images: dict[str, NDArray[np.generic]] = {}
    measures = []
    width_px = QUICK_WIDTH_PX if fixture.is_quick else WIDTH_PX
    rooms = reflective_rooms.rooms()
    for name, scene in rooms.items():
        traced = traced_paths(scene, width_px, SAMPLES)
        everywhere = np.ones(traced.shape[:2], dtype=np.bool_)
        for backend in BACKENDS:
            label = name if backend == "rays" else f"{name}, back end cube"
            ours = rendered(scene, width_px, backend=backend)
            least = MIN_DB[name] if backend == "rays" else min_by_cube_db(name)
            value = psnr_db(ours, traced, everywhere)
            measures.append(Measure(f"{label}: PSNR", value, "dB", least, at_least=True))
            if backend == "rays" or name in BY_PROBES:
                caption = name if backend == "rays" else f"{name}, cube"
                images |= beside(caption, traced, ours, everywhere)
    pose = reflective_rooms.camera_pose()
    measures += beam_measures(rooms["thin pane"], rooms["planar mirror"], pose)
    return Section(
        title,
        "A room with luminous walls, reflected in a mirror, a glossy floor and metal balls, and "
        "seen through a pane and a glass ball, by `--backend rays` and by the default back end, "
        "`cube`, which approximates balls by probes. Mitsuba's paths are converged. Its shadowing "
        "and masking of facets are uncorrelated. A lidar at the camera's place is compared with "
        "straight rays behind the pane, and with the mirrored room.",
        measures,
        figures=[CaptionedFigure("reflections", gallery(images, 3),
                                 "Rooms by both renderers, and their difference × 8.")],
    )  # fmt: skip


def min_by_cube_db(name: str) -> float:
    """Least PSNR of a room by the back end of cubes."""
    return MIN_BY_PROBES_DB if name in BY_PROBES else MIN_DB[name]


def rendered(
    scene: Scene, width_px: int, supersampling: int = SUPERSAMPLING, backend: BackendName = "rays"
) -> Floats32:
    """Linear image (height, width, 3) of a room by omnisim, clipped to white."""
    camera = reflective_rooms.camera(width_px, supersampling)
    with open_sensor(scene, camera, backend=backend) as renderer:
        ours = renderer.render(reflective_rooms.camera_pose(), linear=True).linear
    assert ours is not None
    return np.clip(ours[..., :3], 0.0, 1.0)


def traced_paths(scene: Scene, width_px: int, samples: int) -> Floats32:
    """Linear image (height, width, 3) of a room by Mitsuba, clipped to white."""
    from omnisim.validation.oracles.mitsuba_light import trace_reflections  # of an extra

    camera, pose = reflective_rooms.camera(width_px, 1), reflective_rooms.camera_pose()
    assert isinstance(camera.model, PerspectiveCamera)
    return np.clip(trace_reflections(scene, camera.model, pose, samples), 0.0, 1.0)
