"""What is left out of a frame because nobody sees it, is not seen: the picture stays the same."""

from dataclasses import replace

import numpy as np
import pytest

from omnisim import OmniCamera, Renderer
from omnisim.gpu.culling import cluster_culling
from omnisim.gpu.culling.frustum_culling import FrustumCuller
from omnisim.gpu.scene.cube_pass import CubePass
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.surface_program import SurfacePrograms
from omnisim.poses import pose
from omnisim.scene import load_scene
from omnisim.sensors.tiles import sensor_tiles
from tests.scenes import room, scene_of

TURNS = len(cluster_culling.WORTH_A_TURN)
POSITIONS_M = ((-1.0, 0.3, 1.2), (1.0, 0.3, 1.2))


@pytest.fixture
def always_tested(monkeypatch):
    """As in a scene of very many triangles."""
    monkeypatch.setattr(cluster_culling, "WORTH_A_TURN", (0,) * TURNS)


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.usefixtures("always_tested")
def test_the_picture_is_the_same_as_without_leaving_out_anything(context, samples):
    scene = load_scene("mapping")
    sensor = OmniCamera(supersampling=1, texels_per_pixel=1.0)
    buffers = SceneBuffers(context, scene)
    surfaces = SurfacePrograms(buffers, scene.lighting)
    plan = sensor_tiles(sensor, sensor.model, 1.0, subdivide=True)

    def cube_pass(plain):
        return CubePass(
            context, buffers, surfaces, plan, sensor.near_m, sensor.far_m, samples, unlit=True,
            background=(0.0, 0.0, 0.0), plain=plain,
        )  # fmt: skip

    quick, plain = cube_pass(False), cube_pass(True)
    for position_m in POSITIONS_M:
        base = sensor.base_pose(position_m)
        atlases = [
            np.frombuffer(one.render(base).read(), dtype=np.float16).astype(np.float32)
            for one in (quick, plain)
        ]
        differs = np.abs(atlases[0] - atlases[1]) > 0.02
        # the same triangles come from other matrices: an edge may round to the other side of a
        # texel, but a chunk that is missing shows as many texels together
        assert np.count_nonzero(differs) < 1e-3 * differs.size
        # of several samples, depth cannot be read
        assert quick._static._culling._turn == (TURNS if samples == 1 else 0)


@pytest.mark.usefixtures("context")
def test_a_mesh_without_triangles_changes_nothing():
    sensor = OmniCamera(supersampling=1, texels_per_pixel=1.0)
    nothing = replace(room(), triangles=np.zeros((0, 3), dtype=np.uint32))
    pictures = []
    for meshes in ([room()], [room(), nothing], [nothing, room()]):
        with Renderer(scene_of(meshes), sensor) as renderer:
            pictures.append(renderer.render(sensor.base_pose((0.0, 0.0, 0.0))).rgba)
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


@pytest.mark.usefixtures("context", "always_tested")
@pytest.mark.parametrize("far_m", [np.inf, 3.0])
def test_the_picture_is_the_same_to_the_last_bit_when_everything_is_drawn(monkeypatch, far_m):
    """What is turned away, out of view or hidden makes no texel another colour."""
    scene = load_scene("mapping")
    sensor = OmniCamera(supersampling=1, texels_per_pixel=1.0, far_m=far_m)
    poses = [
        pose(scene.start.position_m + 0.3 * np.array([turn, -turn, 0.3]), yaw_deg=50.0 * turn)
        for turn in range(12)
    ]
    with Renderer(scene, sensor) as renderer:
        little = [renderer.render(one).rgba for one in poses]
        drawn = renderer._passes.cube._static.triangles
        monkeypatch.setattr(
            cluster_culling.ClusterCuller,
            "_turned_away",
            lambda *given: np.zeros(len(given[-1]), dtype=np.bool_),
        )
        monkeypatch.setattr(
            FrustumCuller, "in_view", lambda _, view, *__: (np.arange(len(view)), None)
        )
        monkeypatch.setattr(cluster_culling, "WORTH_A_TURN", (10**9,) * TURNS)
        everything = [renderer.render(one).rgba for one in poses]
        assert drawn < renderer._passes.cube._static.triangles / 20
    np.testing.assert_array_equal(little, everything)
