"""Triangles at the pixels of optical systems near furniture, against rays cast by Embree."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.stage import Stage
from omnisim.report.measure import Measure
from omnisim.report.report import ResultTable, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation.fixture import Fixture
from omnisim.validation.optical_systems import validation_systems
from omnisim.validation.same_triangles import (
    BESIDE_M,
    SameTriangles,
    pose_beside_nearest,
    same_triangles,
)

SCENES = ("soccer", "mapping")
SYSTEMS = ("tilted mirror", "sphere", "cone")
CAST_BOUND, ALONE_BOUND, UNDECIDED_BOUND = 99.9, 99.4, 100.0


def check(fixture: Fixture, title: str) -> Section:
    """Compare the triangles by virtual cameras and by rays, close to an object in each scene."""
    compared = {
        (name, system): shares
        for name in (SCENES[:1] if fixture.is_quick else SCENES)
        for system, shares in measure_triangles(fixture, load_scene(name)).items()
    }
    return triangle_section(title, compared)


def measure_triangles(fixture: Fixture, scene: Scene) -> dict[str, SameTriangles]:
    """Shares of pixels with equal triangles, by system name, close to an object in a scene."""
    shares = {}
    with Stage(scene, device=fixture.device) as stage:
        rays = RayScene(scene)
        for name in SYSTEMS:
            sensor = OmniCamera(validation_systems()[name])
            start = sensor.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
            pose = pose_beside_nearest(sensor, rays, start)
            shares[name] = same_triangles(stage, rays, sensor, pose)
    return shares


def triangle_section(title: str, compared: Mapping[tuple[str, str], SameTriangles]) -> Section:
    """Section of the report with shares of pixels, given by scene and system."""
    shares = list(compared.values())
    cast = [one.undecided_cast for one in shares if not math.isnan(one.undecided_cast)]
    return Section(
        title,
        "Share of pixels that show the first triangle on their exact ray, as cast by Embree, from "
        f"positions {BESIDE_M} m from the nearest object. Virtual cameras at one viewpoint leave "
        "some pixels undecided; the shares are with and without rays for these pixels.",
        (
            Measure("same triangle, rays for undecided pixels",
                    _percent(one.cast for one in shares), "%", CAST_BOUND, at_least=True),
            Measure("same triangle, virtual cameras alone", _percent(one.alone for one in shares),
                    "%", ALONE_BOUND, at_least=True),
            Measure("same triangle, of the undecided pixels by rays", _percent(cast), "%",
                    UNDECIDED_BOUND, at_least=True),
        ),
        tables=(
            ResultTable(
                "Pixels of the same triangle in %",
                ("scene", "system", "with rays", "without", "undecided"),
                tuple(
                    (scene, system, f"{100.0 * one.cast:.3f}", f"{100.0 * one.alone:.3f}",
                     f"{100.0 * one.undecided:.2f}")
                    for (scene, system), one in compared.items()
                ),
            ),
        ),
    )  # fmt: skip


def _percent(shares: Iterable[float]) -> float:
    """Minimum share in percent; NaN without shares."""
    return 100.0 * min(shares, default=math.nan)
