"""Triangles at the pixels of optical systems near furniture, against rays cast by Embree."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError
from omnisim.core.poses import pose
from omnisim.ground_truth.hits import NO_DETAILS
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraSetup, HitSource, ScenePoses
from omnisim.rendering.opengl.parallax_camera import ParallaxCamera
from omnisim.rendering.rays.caster import Rays
from omnisim.rendering.rays.ray_backend import RayHitSource
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.stage import Stage
from omnisim.report.report import Measure, ResultTable, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation.fixture import Fixture
from omnisim.validation.optical_systems import validation_systems

SCENES = ("soccer", "mapping")
SYSTEMS = ("tilted mirror", "sphere", "cone")
CAST_BOUND, ALONE_BOUND, UNDECIDED_BOUND = 99.9, 99.4, 100.0
BESIDE_M = 0.2
_DIRECTIONS = 720  # searched for the nearest object
_MIN_M = 0.05


def check(fixture: Fixture, title: str) -> Section:
    """Compare the triangles by virtual cameras and by rays, close to an object in each scene."""
    names = SCENES[:1] if fixture.is_quick else SCENES
    compared = {
        (name, system): shares
        for name in names
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
    cast = [share.undecided_cast for share in shares if not math.isnan(share.undecided_cast)]
    return Section(
        title,
        "Share of pixels that show the first triangle on their exact ray, as cast by Embree, from "
        f"positions {BESIDE_M} m from the nearest object. Virtual cameras at one viewpoint leave "
        "some pixels undecided; the shares are with and without rays for these pixels.",
        (
            Measure("same triangle, rays for undecided pixels",
                    100.0 * min(share.cast for share in shares), "%", CAST_BOUND, at_least=True),
            Measure("same triangle, virtual cameras alone",
                    100.0 * min(share.alone for share in shares), "%", ALONE_BOUND, at_least=True),
            Measure("same triangle, of the undecided pixels by rays",
                    100.0 * min(cast, default=math.nan), "%", UNDECIDED_BOUND, at_least=True),
        ),
        (ResultTable("Pixels of the same triangle in %",
                     ("scene", "system", "with rays", "without", "undecided"),
                     tuple((scene, system, f"{100.0 * share.cast:.3f}",
                            f"{100.0 * share.alone:.3f}", f"{100.0 * share.undecided:.2f}")
                           for (scene, system), share in compared.items())),),
    )  # fmt: skip


class SameTriangles(NamedTuple):
    """Shares of pixels at which the triangle is that of the pixel's exact ray."""

    cast: float  # among all pixels, with undecided pixels cast as rays
    alone: float  # among all pixels, by the virtual cameras only
    decided: float  # among the pixels that the virtual cameras decide
    undecided_cast: float  # among undecided pixels, cast as rays; NaN: no undecided pixels
    undecided: float  # share of undecided pixels among all pixels


def same_triangles(
    stage: Stage, rays: RayScene, sensor: OmniCamera, world_from_base: Floats
) -> SameTriangles:
    """Compare the triangles of virtual cameras and of exact rays at all valid pixels.

    Raises:
        OpticsError: the sensor is central.
    """
    poses = ScenePoses(world_from_base @ sensor.base_from_rig, ())
    with stage.current():
        camera = stage.backend.camera(CameraSetup(sensor, False, frozenset(), 0, ()))
        if not isinstance(camera, ParallaxCamera):
            raise OpticsError("camera: expected an optical system, got a central camera")
        judge = RayHitSource(rays, camera.setup)
        expected = _Triangles.of(judge, poses)
        sources = camera.make_hits(NO_DETAILS, True), camera.make_hits(NO_DETAILS, False)
        cast, alone = (
            _Triangles.of(source, poses).equal(expected)[judge.has_ray] for source in sources
        )
        undecided = sources[1].undecided[judge.has_ray]
    stage.collect()
    return SameTriangles(
        float(cast.mean()),
        float(alone.mean()),
        float(alone[~undecided].mean()),
        float(cast[undecided].mean()) if undecided.any() else np.nan,
        float(undecided.mean()),
    )


def pose_beside_nearest(sensor: OmniCamera, rays: RayScene, start: Floats) -> Floats:
    """Pose (4, 4) of the base, moved horizontally until its sensor is `BESIDE_M` from an object.

    The object is the nearest at the sensor's height, among those at least twice as far away.
    """
    sensor_m = (start @ sensor.base_from_rig)[:3, 3]
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    directions = np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
    near_m, far_m = np.full(len(angles), _MIN_M), np.full(len(angles), np.inf)
    origins_m = np.tile(sensor_m, (len(angles), 1))
    ranges_m = rays.first_hits(Rays(origins_m, directions, near_m, far_m)).ranges_m
    nearest = int(np.argmin(np.where(ranges_m > 2.0 * BESIDE_M, ranges_m, np.inf)))
    away_m = (ranges_m[nearest] - BESIDE_M) * directions[nearest]
    return pose(tuple(away_m.tolist())) @ start


class _Triangles(NamedTuple):
    """Triangle indices and instance names at pixels (height, width)."""

    names: NDArray[np.str_]  # of the instances
    numbers: NDArray[np.uint32]

    @staticmethod
    def of(source: HitSource, poses: ScenePoses) -> _Triangles:
        """Triangles hit by the rays of all pixels, for the given poses."""
        hits = source.hits(poses)
        names = np.array(["", *(name for _, name in source.draws)])
        return _Triangles(names[hits.draw_ids], hits.triangles)

    def equal(self, other: _Triangles) -> Bools:
        """Mask (height, width) of pixels with equal triangles, or with none in both."""
        same = (self.numbers == other.numbers) | (self.names == "")
        return same & (self.names == other.names)
