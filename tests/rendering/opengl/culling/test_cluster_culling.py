"""Frusta, normal cones and draw commands, beside brute force over points and triangles."""

import numpy as np
import pytest

from omnisim.core.cube import FACE_FROM_RIG
from omnisim.core.poses import pose
from omnisim.rendering.atlas.tile_plan import TileViews, clips_from_rig, plan_tiles
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.culling.cluster_culling import ClusterCuller, Views
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.model import AlphaMode, Material, Mesh
from tests.rendering.opengl.cluster_readback import read_vertices
from tests.rendering.opengl.commands import submitted_commands
from tests.rendering.opengl.sheets import sheet
from tests.scenes import scene_of

CAMERA = OmniCamera().resized(200).model
PLAN = plan_tiles(CAMERA, CAMERA.rig_from_optical, subdivide=True)
NEAR_M = 0.05
MASKED = Material(alpha_mode=AlphaMode.MASK)


def _shown(tile, points, far_m, world_from_rig):
    """Mask of points (..., 3), viewpoint frame, that a tile shows: by its tangents."""
    local = points @ world_from_rig[:3, :3] @ FACE_FROM_RIG[tile.face].T
    depth = local[..., 2]
    tangents = local[..., :2] / np.where(depth > NEAR_M, depth, 1.0)[..., None]
    first, last = tile.padded_region
    inside = np.all((tangents >= first) & (tangents <= last), axis=-1)
    return inside & (depth > NEAR_M) & (depth < far_m)


def test_matrices_show_what_planes_keep():
    generator = np.random.default_rng(2)
    world_from_rig = pose((0.0, 3.0, 1.0), roll_deg=-8.0, yaw_deg=200.0)
    points = generator.uniform(-5.0, 5.0, (4000, 3))
    views = TileViews(PLAN, NEAR_M, np.inf).at(world_from_rig)
    kept = views.cull(points, np.zeros(len(points)))
    for tile, clip, of_tile in zip(views.tiles, views.clips_from_viewpoint, kept, strict=True):
        x, y, z, w = (points @ clip[:, :3].T + clip[:, 3]).T
        drawn = (np.abs(x) <= w) & (np.abs(y) <= w) & (z <= w) & (w > 0.0)
        assert drawn.any()
        # points on a plane itself do not occur by chance
        assert np.array_equal(drawn, of_tile)
        assert np.array_equal(drawn, _shown(tile, points, np.inf, world_from_rig))


def test_spheres_are_kept_in_tiles_that_show_a_point_of_them():
    generator = np.random.default_rng(3)
    world_from_rig = pose((0.0, 3.0, 1.0), roll_deg=-8.0, yaw_deg=200.0)
    views = TileViews(PLAN, NEAR_M, 6.0).at(world_from_rig)
    centers_m, radii_m = generator.uniform(-5.0, 5.0, (300, 3)), generator.uniform(0.1, 1.0, 300)
    directions = generator.normal(size=(100, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points_m = centers_m[:, None] + radii_m[:, None, None] * directions
    kept = views.cull(centers_m, radii_m)
    for tile, of_tile in zip(views.tiles, kept, strict=True):
        shown = _shown(tile, points_m, 6.0, world_from_rig).any(axis=1)
        assert 0 < np.count_nonzero(shown) <= np.count_nonzero(of_tile) < 150
        assert not np.any(shown & ~of_tile)


def _stack(count=32, height_m=4.0):
    """Small sheets above each other, all fronts up: a cluster that is far higher than wide."""
    one = sheet("a sheet", 0, side=1, size_m=0.2, bumps_m=0.0)
    up_m = np.linspace(-0.5, 0.5, count)[:, None, None] * (0.0, 0.0, height_m)
    triangles = one.triangles + 4 * np.arange(count)[:, None, None]
    return Mesh(
        "stack",
        (one.positions + up_m).reshape(-1, 3).astype(np.float32),
        triangles.reshape(-1, 3).astype(np.uint32),
        0,
    )


def _culler(context, buffers, far_m, triangles=None):
    geometry, depths_m = buffers.clustered_geometry, (NEAR_M, far_m)
    clips = clips_from_rig(PLAN, *depths_m)
    views = Views(context, clips, PLAN.rectangles_px, geometry.anchor_m, geometry.objects)
    size_px = (PLAN.width_px, PLAN.height_px)
    buffers = geometry.buffers
    batches = buffers.groups_of_bucket
    return ClusterCuller(
        context, buffers, batches, views, None, (), size_px, depths_m, triangles=triangles
    ), views


def _drawn(culler, geometry):
    """Mask (views, triangles) of the triangles that commands draw."""
    triangles = geometry.triangles
    drawn = np.zeros((len(PLAN.tiles), len(triangles)), dtype=np.bool_)
    stored = np.frombuffer(read_buffer(geometry.indices), "<u4").reshape(-1, 3)
    number = {corners: at for at, corners in enumerate(map(tuple, triangles.tolist()))}
    for count, instances, first, base, instance in submitted_commands(culler).tolist():
        assert (instances, base) == (1, 0)
        own = [number[tuple(one)] for one in stored[first // 3 : (first + count) // 3].tolist()]
        assert own == sorted(own)  # also those of them that are copied
        of_view = drawn[instance % len(PLAN.tiles)]
        assert not of_view[own].any()  # nothing is drawn twice
        of_view[own] = True
    return drawn


@pytest.mark.parametrize("far_m", [np.inf, 2.5])
@pytest.mark.parametrize("culls_triangles", [False, True])
def test_all_triangles_that_a_tile_shows_are_drawn(context, far_m, culls_triangles):
    """Triangles of all clusters, from viewpoints at random, whose front covers a center."""
    meshes = [
        sheet("smooth", 0, side=40, size_m=4.0, bumps_m=0.01),
        sheet("rough", 0, side=40, size_m=2.0, bumps_m=0.05, seed=1),
        sheet("both sides", 1, side=20, seed=2),
        _stack(),
    ]
    poses = [np.eye(4), pose((0.0, 0.0, 1.0), roll_deg=60.0), pose((1.0, 0.0, 0.5))]
    poses.append(pose((-1.0, 1.0, 0.0), pitch_deg=20.0))
    poses[1][:3, :3] = poses[1][:3, :3] @ np.diag((1.0, -1.0, 1.0))
    scene = scene_of(meshes, [Material(), Material(double_sided=True)], poses)
    buffers = SceneBuffers(context, scene)
    geometry = buffers.clustered_geometry
    vertices = read_vertices(geometry)
    corners_m = vertices["in_position"][geometry.triangles].astype(np.float64) + geometry.anchor_m
    both_sides = np.array([bucket.double_sided for bucket in geometry.buckets])
    both_sides = both_sides[geometry.bucket_of_cluster].repeat(geometry.clusters.triangles)
    culler, views = _culler(context, buffers, far_m, geometry.cullable if culls_triangles else None)
    generator = np.random.default_rng(3)
    seen = submitted = 0
    for number, viewpoint_m in enumerate(generator.uniform(-3.0, 3.0, (12, 3))):
        world_from_rig = pose(viewpoint_m, roll_deg=9.0, yaw_deg=31.0 * number)
        views.write((ScenePoses(world_from_rig),))
        culler.run(0)
        drawn = _drawn(culler, geometry)
        local = corners_m - viewpoint_m
        normals = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])
        is_front = both_sides | (np.sum(normals * local[:, 0], axis=1) < 0.0)
        middle = local.mean(axis=1)
        for tile, of_view in zip(PLAN.tiles, drawn, strict=True):
            shown = is_front & _shown(tile, middle, far_m, world_from_rig)
            shown &= _is_large(tile, local, world_from_rig)
            assert not np.any(shown & ~of_view)
            seen += np.count_nonzero(shown)
        submitted += np.count_nonzero(drawn)
    # boxes and cones are wider than what they hold
    most = 0.085 if culls_triangles else 0.2
    assert 0 < seen < submitted < most * 12 * len(PLAN.tiles) * len(corners_m)


def _is_large(tile, corners_m, world_from_rig):
    """Mask of triangles (n, 3, 3) that cover a texel's center for sure: by their inscribed circles,
    were the image not seen at an angle."""  # fmt: skip
    local = corners_m @ world_from_rig[:3, :3] @ FACE_FROM_RIG[tile.face].T
    depth = np.maximum(local[..., 2:], 1e-9)
    texels = 0.5 * tile.face_size_px * local[..., :2] / depth
    one, two, three = texels.transpose(1, 0, 2)
    (x, y), (u, v) = (two - one).T, (three - one).T
    area = 0.5 * np.abs(x * v - y * u)
    around = sum(np.linalg.norm(a - b, axis=1) for a, b in ((one, two), (two, three), (three, one)))
    return 2.0 * area / np.maximum(around, 1e-9) > 0.75


def _drawn_clusters(commands, clusters):
    """Number of the clusters that commands (n, 5) draw, whole and in every tile."""
    ends = clusters.first + clusters.triangles
    first, last = commands[:, 2] // 3, (commands[:, 2] + commands[:, 0]) // 3
    assert np.all(np.isin(first, clusters.first))
    assert np.all(np.isin(last, ends))
    return int(np.sum(np.searchsorted(ends, last) - np.searchsorted(clusters.first, first) + 1))


def test_near_clusters_come_first_and_every_run_gives_the_same(context):
    meshes = [sheet(f"sheet {number}", number % 2, seed=number) for number in range(12)]
    poses = [pose((0.7 * number, 0.3, -0.4)) for number in range(12)]
    buffers = SceneBuffers(context, scene_of(meshes, [Material(), MASKED], poses))
    geometry = buffers.clustered_geometry
    culler, views = _culler(context, buffers, np.inf)
    middle_m = 0.5 * (geometry.clusters.aabb_min + geometry.clusters.aabb_max) + geometry.anchor_m
    runs = []
    for _ in range(3):
        views.write((ScenePoses(np.eye(4)),))
        culler.run(0)
        runs.append(submitted_commands(culler))
    assert all(np.array_equal(run, runs[0]) for run in runs)
    # clusters that follow each other share commands
    assert len(runs[0]) < 0.8 * _drawn_clusters(runs[0], geometry.clusters)
    cluster = np.searchsorted(geometry.clusters.first, runs[0][:, 2] // 3)
    distance_m = np.linalg.norm(middle_m[cluster], axis=1)
    bucket = geometry.bucket_of_cluster[cluster]
    assert len(np.unique(bucket)) == 2
    assert np.all(np.diff(bucket) >= 0)
    for number in range(2):
        own = distance_m[bucket == number]
        # bins are half a doubling wide, and count from the far sides of boxes
        assert np.all(own[1:] > 0.4 * np.maximum.accumulate(own)[:-1])
        assert own[-20:].mean() > 2.0 * own[:20].mean()
