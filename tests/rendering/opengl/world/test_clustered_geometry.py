"""Clustered geometry: items, positions and winding, and the light that is baked into it."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from omnisim.core.poses import pose as make_pose
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world import clustered_geometry
from omnisim.rendering.opengl.world.clustered_geometry import (
    ClusterShading,
    bake_directional_light,
    shadings,
)
from omnisim.rendering.opengl.world.draw_item import MAX_DISTANCE_M
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_records import CLUSTER_VERTEX
from omnisim.scene.model import AlphaMode, Light, Lighting, LightKind, Material, Mesh
from tests.rendering.opengl.cluster_readback import lights_of, read_vertices
from tests.rendering.opengl.sheets import LAMP, SUN, sheet
from tests.scenes import scene_of, square

MATERIALS = [Material(), Material(alpha_mode=AlphaMode.BLEND)]
NOTHING = Mesh("nothing", np.zeros((3, 3), np.float32), np.zeros((0, 3), np.uint32), 0)


def corners_m(geometry):
    """Corners (n, 3, 3) of all triangles, world."""
    vertices = read_vertices(geometry)
    triangles = geometry.triangles
    return vertices["in_position"][triangles].astype(np.float64) + geometry.anchor_m


def _sorted(corners_m):
    """Triangles in an order of their own; each begins with whichever corner it began with."""
    flat = np.round(corners_m.reshape(len(corners_m), -1), 3)
    return corners_m[np.lexsort(flat.T)]


@pytest.mark.parametrize("far_m", [0.0, 700.0])
def test_triangles_are_where_instances_are_and_fronts_stay_fronts(context, far_m):
    mesh = sheet("sheet", 0, side=20)
    scales = np.diag((1.5, -0.7, 2.0)), np.eye(3)
    poses = []
    for number, scale in enumerate(scales):
        pose = make_pose((far_m + number, -far_m, 2.0), roll_deg=30.0, yaw_deg=50.0 * number)
        pose[:3, :3] = pose[:3, :3] @ scale
        poses.append(pose)
    geometry = SceneBuffers(context, scene_of([mesh, mesh], MATERIALS, poses)).clustered_geometry
    assert geometry.contains.all()
    assert len(geometry.buckets) == 1
    expected = []
    for pose, turn in zip(poses, ((0, 2, 1), (0, 1, 2)), strict=True):
        positions = mesh.positions.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        expected.append(positions[mesh.triangles[:, turn]])  # a mirrored one is turned back
    # half a float32's last digit of what is a few meters from the anchor, however far that is
    np.testing.assert_allclose(
        _sorted(corners_m(geometry)), _sorted(np.concatenate(expected)), atol=1e-6
    )


def test_glass_far_and_empty_meshes_are_not_contained(context):
    meshes = [sheet("near", 0), sheet("glass", 1), sheet("far", 0), NOTHING, sheet("far too", 0)]
    poses = [np.eye(4) for _ in meshes]
    poses[2][0, 3], poses[4][0, 3] = 2.1 * MAX_DISTANCE_M, -2.1 * MAX_DISTANCE_M
    buffers = SceneBuffers(context, scene_of(meshes, MATERIALS, poses))
    contains = buffers.clustered_geometry.contains
    assert [buffers.draw_items[index].mesh.name for index in np.flatnonzero(contains)] == ["near"]
    assert len(corners_m(buffers.clustered_geometry)) == len(meshes[0].triangles)


@pytest.mark.parametrize(("share", "is_contained"), [(0.999, True), (1.001, False)])
def test_wide_ground_is_contained_up_to_the_distance_along_an_axis(context, share, is_contained):
    ground = square(MAX_DISTANCE_M * share)
    scene = scene_of([ground, sheet("near", 0)], [Material()], [make_pose(yaw_deg=90.0)] * 2)
    contains = SceneBuffers(context, scene).clustered_geometry.contains
    assert contains.tolist() == [is_contained, True]


def test_every_mesh_is_contained_and_as_many_copies_as_the_limit_allows(context, monkeypatch):
    meshes = [sheet("tree", 0, side=20), sheet("house", 0, side=30)]
    limit = 2 * len(meshes[0].triangles)
    monkeypatch.setattr(clustered_geometry, "MAX_COPIED_TRIANGLES", limit)
    scene = scene_of(meshes, MATERIALS, [np.eye(4)] * 2)
    trees = (dataclasses.replace(scene.instances[0], name=f"tree {at}") for at in range(4))
    scene = dataclasses.replace(scene, instances=(*trees, scene.instances[1]))
    contains = SceneBuffers(context, scene).clustered_geometry.contains
    assert contains.tolist() == [True, True, True, False, True]


def test_light_on_dynamic_objects_is_not_baked(context):
    lighting = Lighting((0.1, 0.1, 0.1), (SUN,))
    scene = scene_of([sheet("static", 0)], [Material()], lighting=lighting)
    buffers = SceneBuffers(context, scene, (scene_of([sheet("dynamic", 0)], [Material()]),))
    geometry = buffers.clustered_geometry
    assert geometry.contains.all()
    assert geometry.objects == 2
    dynamic = [draw.object_index is not None for draw in buffers.draw_items]
    of_cluster = np.array(dynamic)[geometry.item_of_cluster]
    shadings = np.array([bucket.shading.value for bucket in geometry.buckets])
    shadings = shadings[geometry.bucket_of_cluster]
    assert ClusterShading.BAKED.value in shadings[~of_cluster]
    assert ClusterShading.BAKED.value not in shadings[of_cluster]


def test_scenes_of_glass_and_without_clusters_are_drawn_one_by_one(context):
    scene = scene_of([sheet("glass", 1)], MATERIALS)
    assert SceneBuffers(context, scene).clustered_geometry is None
    buffers = SceneBuffers(context, scene_of([sheet("sheet", 0)]), uses_clusters=False)
    assert buffers.clustered_geometry is None
    assert buffers.shown_one_by_one().all()


def test_vertices_with_two_lights_get_copies_in_every_batch(context, monkeypatch):
    # a corner of a box, whose three faces share vertices: each has its own light
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=np.float32)
    mesh = Mesh("corner", corners, np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2)], np.uint32), 0)
    poses = [make_pose((float(number), 0.0, 0.0), yaw_deg=40.0 * number) for number in range(5)]
    scene = scene_of([mesh] * 5, [Material()], poses, lighting=Lighting((0.1,) * 3, (SUN,)))
    whole = SceneBuffers(context, scene).clustered_geometry
    monkeypatch.setattr(clustered_geometry, "_BATCH_VERTICES", 8)  # two items
    geometry = SceneBuffers(context, scene).clustered_geometry
    assert [bucket.shading for bucket in geometry.buckets] == [ClusterShading.BAKED]
    np.testing.assert_array_equal(corners_m(geometry), corners_m(whole))
    corner = read_vertices(geometry)[geometry.triangles]
    turned = np.cross(*np.moveaxis(np.diff(corners_m(geometry), axis=1), 1, 0))
    normals = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    expected = bake_directional_light(normals.astype(np.float32), scene.lighting)
    for light in np.moveaxis(lights_of(geometry, corner), 1, 0):
        np.testing.assert_allclose(light, expected, atol=1e-6)


def _indices(geometry):
    """Vertex indices (n, 3) of all triangles, without the room behind them."""
    read = np.frombuffer(read_buffer(geometry.indices), dtype="<u4").reshape(-1, 3)
    return read[: geometry.triangle_count]


def test_hidden_items_have_no_triangles_until_they_are_shown_again(context):
    scene = scene_of([sheet("one", 0), sheet("other", 0)], [Material()])
    geometry = SceneBuffers(context, scene).clustered_geometry
    before = _indices(geometry)
    shown = np.array([True, False])
    for _ in range(2):  # the second time as the first
        geometry.show(shown)
        now = _indices(geometry)
        is_shown = shown[geometry.item_of_triangle]
        assert not is_shown.all()
        np.testing.assert_array_equal(now[is_shown], before[is_shown])
        assert not now[~is_shown].any()
    geometry.show(~shown | shown)
    assert np.array_equal(_indices(geometry), before)


UP, LEANING, DOWN, NONE = (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
CORNERS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
LIGHTING = Lighting((0.1, 0.2, 0.3), (SUN,))


def _shading(normals, materials=(7, 7, 7), corners=CORNERS, lighting=LIGHTING):
    vertices = np.zeros(3, dtype=CLUSTER_VERTEX)
    vertices["in_position"], vertices["in_material"] = corners, materials
    normals, triangles = np.array(normals, dtype=np.float32), np.array([[0, 1, 2]], np.uint32)
    values, directions = shadings(
        vertices, normals, triangles, lighting, np.ones(1, dtype=np.bool_)
    )
    return ClusterShading(values[0]), directions[0]


@pytest.mark.parametrize(("normal", "expected"), [(UP, UP), (LEANING, LEANING), (NONE, UP)])
def test_light_of_a_flat_triangle_is_known(normal, expected):
    """One without normals has its own."""
    kind, direction = _shading(3.0 * np.array([normal] * 3))
    assert kind is ClusterShading.BAKED
    np.testing.assert_allclose(direction, expected, atol=1e-7)


@pytest.mark.parametrize(
    ("normals", "kind"),
    [
        ([UP, UP, LEANING], ClusterShading.NORMALS_AGREE),
        ([UP, LEANING, UP], ClusterShading.NORMALS_AGREE),
        ([UP, UP, (1e-3, 0.0, 1.0)], ClusterShading.NORMALS_AGREE),
        ([UP, UP, NONE], ClusterShading.UNKNOWN),
        ([NONE, UP, UP], ClusterShading.UNKNOWN),
        ([UP, UP, DOWN], ClusterShading.UNKNOWN),
        ([DOWN, DOWN, DOWN], ClusterShading.UNKNOWN),
    ],
)
def test_light_of_another_triangle_is_not(normals, kind):
    assert _shading(normals)[0] is kind


def test_many_colors_no_area_and_punctual_lights_are_not_baked():
    for materials in ((7, 8, 7), (7, 7, 8)):
        assert _shading([UP] * 3, materials)[0] is ClusterShading.NORMALS_AGREE
    assert _shading([UP] * 3)[0] is ClusterShading.BAKED
    assert _shading([NONE] * 3, corners=[CORNERS[0]] * 3)[0] is ClusterShading.UNKNOWN
    beside = Lighting((0.1, 0.2, 0.3), (SUN, LAMP))
    assert _shading([UP] * 3, lighting=beside)[0] is ClusterShading.NORMALS_AGREE


def test_light_that_shadows_may_fall_on_is_not_baked():
    sun = replace(SUN, casts_shadow=True)
    shadowed = Lighting((0.1, 0.2, 0.3), (sun,))
    assert _shading([UP] * 3, lighting=shadowed)[0] is ClusterShading.NORMALS_AGREE
    from_below = Lighting((0.1, 0.2, 0.3), (replace(sun, direction=np.array(UP)),))
    assert _shading([UP] * 3, lighting=from_below)[0] is ClusterShading.BAKED


def test_light_is_lamberts():
    sun = Light(LightKind.DIRECTIONAL, (1.0, 0.5, 0.25), 2.0, direction=np.array(DOWN))
    lighting = Lighting((0.1, 0.2, 0.3), (sun,), exposure=0.5)
    light = bake_directional_light(np.array([UP, DOWN, LEANING], dtype=np.float32), lighting)
    expected = [(1.1, 0.7, 0.55), (0.1, 0.2, 0.3), (0.9, 0.6, 0.5)]
    np.testing.assert_allclose(light, expected, rtol=1e-6)


def test_vertices_of_two_triangles_that_differ_are_copied(context):
    """A roof of two flat sides and no normals, and one that bends, on the same vertices."""
    positions = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 1], [0, 1, 1], [0, 2, 0]], np.float32)
    flat = Mesh("flat", positions, np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4]], np.uint32), 0)
    normals = np.array([(0, -1, 1), (0, -1, 1), (0, -1, 1), (0, 0, 1), (0, 1, 1)], np.float32)
    bent = Mesh("bent", positions, flat.triangles, 0, normals=normals)
    for mesh, kinds in ((flat, [2, 2, 2]), (bent, [2, 1, 0])):
        scene = scene_of([mesh], [Material()], lighting=LIGHTING)
        geometry = SceneBuffers(context, scene).clustered_geometry
        vertices, triangles = read_vertices(geometry), geometry.triangles
        assert (geometry.normals is None) == (mesh is flat)
        buckets = np.repeat(geometry.bucket_of_cluster, geometry.clusters.triangles)
        found = [geometry.buckets[bucket].shading.value for bucket in buckets]
        assert sorted(found) == sorted(kinds)
        for triangle, kind in zip(triangles, found, strict=True):
            corners = vertices["in_position"][triangle]
            if kind == ClusterShading.BAKED.value:
                own = np.cross(corners[1] - corners[0], corners[2] - corners[0])
                own = (own / np.linalg.norm(own))[None]
                expected = np.repeat(bake_directional_light(own, LIGHTING), 3, axis=0)
                stored = lights_of(geometry, vertices[triangle])
                np.testing.assert_allclose(stored, expected, atol=1e-4)
            else:
                at = corners + geometry.anchor_m
                numbers = [np.flatnonzero((positions == corner).all(axis=1))[0] for corner in at]
                stored = np.frombuffer(read_buffer(geometry.normals), dtype="<f4").reshape(-1, 3)
                np.testing.assert_array_equal(stored[triangle], normals[numbers])
