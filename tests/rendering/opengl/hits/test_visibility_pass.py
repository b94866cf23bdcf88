"""Triangle IDs of texels: the same, however the static geometry is drawn."""

import numpy as np
import pytest

from omnisim.core.poses import pose as make_pose
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails
from omnisim.rendering.atlas.tile_plan import plan_tiles
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl import scene_view
from omnisim.rendering.opengl.hits.visibility_pass import (
    TriangleIds,
    VisibilityPass,
    cluster_triangle_entries,
)
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.model import AlphaMode, Material
from tests.rendering.opengl.sheets import sheet
from tests.rendering.opengl.world.test_clustered_geometry import corners_m
from tests.scenes import room, scene_of
from tests.vehicles import box, checkered

MATERIALS = [
    Material(double_sided=True),
    Material(texture=checkered(0), alpha_mode=AlphaMode.MASK, double_sided=True),
    Material(base_color=(0.2, 0.3, 0.9, 0.7), alpha_mode=AlphaMode.BLEND),
]


def _scene():
    """Sheets of some hundred triangles, one of them mirrored, holes, glass, and a room."""
    meshes = [room(), sheet("a", 0, seed=1), sheet("b", 1, seed=2), sheet("a", 0, seed=1)]
    meshes.append(box("glass", 2, half_m=0.3))
    poses = [
        make_pose((0.1 * n, 0.9 * n - 1.3, -0.6), roll_deg=8.0 * n, pitch_deg=5.0, yaw_deg=40.0 * n)
        for n in range(5)
    ]
    poses[0] = np.eye(4)
    poses[3][:3, :3] = poses[3][:3, :3] @ np.diag((1.0, -1.0, 1.0))
    return scene_of(meshes, MATERIALS, poses)


def _surfaces(visibility, buffers, pose, details=NO_DETAILS):
    """1 + number of the item, and number of the triangle, of every texel (height, width, 2)."""
    visibility.render([ScenePoses(pose)], details)
    size = visibility.id_atlas.height, visibility.id_atlas.width
    seen = np.frombuffer(visibility.id_atlas.read(), dtype="<u4").reshape(size)
    entries = np.frombuffer(visibility.triangle_ids.texture.read(), dtype="<u4").reshape(-1, 2)
    return np.where(seen[..., None] > 0, entries[seen.astype(np.int64) - 1], 0)


def _pass(buffers, details=NO_DETAILS):
    camera = OmniCamera(polygons=None).resized(120).model
    plan = plan_tiles(camera, camera.rig_from_optical, 1.5)
    return VisibilityPass(buffers, plan, VirtualCameras(0.05, np.inf), details)


@pytest.mark.parametrize(
    ("min_triangles", "details"),  # by occlusion passes, and by one
    [
        (0, NO_DETAILS),
        (0, HitDetails(materials=True)),
        (10**9, NO_DETAILS),
        (10**9, HitDetails(albedos=True)),
    ],
)
def test_ids_are_those_of_instances_drawn_one_by_one(context, monkeypatch, min_triangles, details):
    monkeypatch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (min_triangles,) * 4)
    scene = _scene()
    clustered = SceneBuffers(context, scene)
    reference = SceneBuffers(context, scene, uses_clusters=False)
    assert clustered.clustered_geometry.contains.sum() == 4
    assert reference.clustered_geometry is None
    passes = [(_pass(one, details), one) for one in (clustered, reference)]
    for pose in (
        make_pose((0.0, 0.0, 0.4)),
        make_pose((0.3, -0.2, 0.2), roll_deg=9.0, pitch_deg=-5.0, yaw_deg=70.0),
    ):
        ours, theirs = (_surfaces(one, buffers, pose, details) for one, buffers in passes)
        assert len(np.unique(theirs.reshape(-1, 2), axis=0)) > 200
        # matrices are multiplied in another order: an edge takes the texel beside it
        assert np.mean((ours != theirs).any(axis=-1)) < 1e-3


def test_triangles_of_clusters_are_found_again_in_their_instances(context):
    """Though the geometry has copies of vertices, in places of their own."""
    buffers = SceneBuffers(context, _scene())
    geometry, draws = buffers.clustered_geometry, buffers.draw_items
    found = cluster_triangle_entries(geometry, draws)
    taken = np.flatnonzero(geometry.contains).tolist()
    assert len(np.unique(found)) == len(found) == sum(draws[one].triangles for one in taken)
    all_corners_m = corners_m(geometry)
    for index in taken:
        draw, mine = draws[index], found["item_plus_one"] == index + 1
        own_m = draw.mesh.positions[draw.mesh.triangles[found["triangle"][mine]]]
        own_m = own_m @ draw.object_from_mesh[:3, :3].T + draw.object_from_mesh[:3, 3]
        if draw.flips_winding:  # turned back
            own_m = own_m[:, (0, 2, 1)]
        np.testing.assert_allclose(all_corners_m[mine], own_m, atol=1e-6)


def test_the_table_has_items_drawn_one_by_one_and_then_clusters(context):
    buffers = SceneBuffers(context, _scene())
    one_by_one = np.flatnonzero(~buffers.clustered_geometry.contains)
    ids = TriangleIds(buffers, one_by_one)
    of_clusters = cluster_triangle_entries(buffers.clustered_geometry, buffers.draw_items)
    held = np.frombuffer(ids.texture.read(), dtype=of_clusters.dtype)
    first = ids.first_of_clusters
    np.testing.assert_array_equal(held[first : first + len(of_clusters)], of_clusters)
    assert len(one_by_one)
    for index in one_by_one.tolist():
        first, count = ids.first_of_item[index], buffers.draw_items[index].triangles
        assert held["item_plus_one"][first : first + count].tolist() == [index + 1] * count
        assert held["triangle"][first : first + count].tolist() == list(range(count))
