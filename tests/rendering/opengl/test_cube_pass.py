"""Culling leaves the image as it is."""

from dataclasses import replace

import numpy as np
import pytest

from omnisim import OmniCamera, open_sensor
from omnisim.core.poses import pose
from omnisim.rendering.atlas.tile_plan import sensor_tiles
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl import scene_view
from omnisim.rendering.opengl.camera_frame import CubePass
from omnisim.rendering.opengl.culling import cluster_culling
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.surfaces.surface_program import SurfacePrograms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene import load_scene
from tests.rendering.opengl.commands import count_triangles, show_all
from tests.scenes import room, scene_of

POSITIONS_M = ((-1.0, 0.3, 1.2), (1.0, 0.3, 1.2))


@pytest.fixture
def always_tested(monkeypatch):
    """As in a scene of very many triangles."""
    monkeypatch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (0, 0, 0, 0))
    monkeypatch.setattr(scene_view, "MIN_CULLED_TRIANGLES", 0)


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.usefixtures("always_tested")
def test_the_image_is_that_of_instances_drawn_one_by_one(context, samples):
    scene = load_scene("mapping")
    sensor = OmniCamera(supersampling=1, texels_per_pixel=1.0)
    plan = sensor_tiles(sensor, sensor.model, 1.0, subdivide=True)
    cameras = VirtualCameras(sensor.near_m, sensor.far_m, samples, unlit=True)

    def cube_pass(uses_clusters):
        buffers = SceneBuffers(context, scene, uses_clusters=uses_clusters)
        return CubePass(buffers, SurfacePrograms(buffers, scene.lighting), plan, cameras)

    clustered, reference = cube_pass(True), cube_pass(False)
    for position_m in POSITIONS_M:
        base = sensor.base_pose(position_m)
        atlases = []
        for one in (clustered, reference):
            one.draw((ScenePoses(base),))
            texels = np.frombuffer(one.atlas.read(), dtype=np.float16)
            atlases.append(texels.astype(np.float32))
        differs = np.abs(atlases[0] - atlases[1]) > 0.02
        # the same triangles come from other matrices: an edge may round to the other side of a
        # texel, but a cluster that is missing shows as many texels together
        assert np.count_nonzero(differs) < 1e-3 * differs.size
    # of several samples, depth cannot be read
    assert clustered.tiles.culler.passes == (4 if samples == 1 else 1)


def test_clusters_of_groups_of_narrow_triangles_are_tested_in_later_passes_only(
    context, monkeypatch
):
    scene, tested = load_scene("mapping"), []
    sensor = OmniCamera(supersampling=1, texels_per_pixel=1.0)
    for least in (10**9, 0):  # a single pass, and four
        monkeypatch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (least,) * 4)
        plan = sensor_tiles(sensor, sensor.model, 1.0, subdivide=True)
        cameras = VirtualCameras(sensor.near_m, sensor.far_m, unlit=True)
        buffers = SceneBuffers(context, scene)
        cube = CubePass(buffers, SurfacePrograms(buffers, scene.lighting), plan, cameras)
        cube.draw((ScenePoses(sensor.base_pose(POSITIONS_M[0])),))
        culler = cube.tiles.culler
        lists = np.frombuffer(read_buffer(culler._lists), "<u4")[: 4 * cluster_culling._LISTS]
        tested.append(lists[4 * cluster_culling._TESTED + 3 :: 4][: culler.passes].tolist())
    assert 0 < tested[1][0] < 0.8 * tested[0][0]
    assert sum(tested[1]) < tested[0][0]  # all of the groups in view


@pytest.mark.usefixtures("context")
def test_a_mesh_without_triangles_changes_nothing():
    sensor = OmniCamera(supersampling=1, texels_per_pixel=1.0)
    nothing = replace(room(), triangles=np.zeros((0, 3), dtype=np.uint32))
    images = []
    for meshes in ([room()], [room(), nothing], [nothing, room()]):
        with open_sensor(scene_of(meshes), sensor) as renderer:
            images.append(renderer.render(sensor.base_pose((0.0, 0.0, 0.0))).rgba)
    for image in images[1:]:
        np.testing.assert_array_equal(image, images[0])


@pytest.mark.usefixtures("context", "always_tested")
@pytest.mark.parametrize("far_m", [np.inf, 3.0])
def test_the_image_is_the_same_to_the_last_bit_when_nothing_is_culled(monkeypatch, far_m):
    scene = load_scene("mapping")
    sensor = OmniCamera(supersampling=1, texels_per_pixel=1.0, far_m=far_m).resized(180)
    poses = [
        pose(scene.start.position_m + 0.3 * np.array([step, -step, 0.3]), yaw_deg=50.0 * step)
        for step in range(6)
    ]
    with open_sensor(scene, sensor) as renderer:
        drawn = count_triangles(renderer._passes.cube.tiles.culler)
        culled = [renderer.render(one).rgba for one in poses]
    monkeypatch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (10**9,) * 4)
    monkeypatch.setattr(scene_view, "MIN_CULLED_TRIANGLES", 10**9)
    with open_sensor(scene, sensor) as renderer:
        show_all(renderer._passes.cube.tiles.culler)
        everything = count_triangles(renderer._passes.cube.tiles.culler)
        unculled = [renderer.render(one).rgba for one in poses]
        assert sum(drawn) < sum(everything) / 20
    np.testing.assert_array_equal(culled, unculled)
