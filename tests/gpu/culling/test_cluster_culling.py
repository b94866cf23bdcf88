"""Frustum planes and normal cones, beside brute force over points."""

import numpy as np

from omnisim.cube import FACE_FROM_RIG
from omnisim.gpu.atlas.tile_plan import plan_tiles
from omnisim.gpu.atlas.tile_views import TileViews
from omnisim.gpu.culling.cluster_culling import ClusterCuller
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.vertex_format import VERTEX
from omnisim.poses import pose
from omnisim.scene.model import Material, Mesh
from omnisim.sensors import OmniCamera
from tests.gpu.sheets import sheet
from tests.scenes import scene_of

CAMERA = OmniCamera().resized(200).model
PLAN = plan_tiles(CAMERA, CAMERA.rig_from_optical, subdivide=True)
NEAR_M = 0.05


def _views(far_m, world_from_rig):
    return TileViews(PLAN, NEAR_M, far_m).at(world_from_rig)


def _shown(view, points, far_m, world_from_rig):
    """Mask of points (..., 3), viewpoint frame, that a tile shows: by its tangents."""
    local = points @ world_from_rig[:3, :3] @ FACE_FROM_RIG[view.tile.face].T
    depth = local[..., 2]
    tangents = local[..., :2] / np.where(depth > NEAR_M, depth, 1.0)[..., None]
    first, last = view.tile.padded_region
    inside = np.all((tangents >= first) & (tangents <= last), axis=-1)
    return inside & (depth > NEAR_M) & (depth < far_m)


def test_matrices_show_what_planes_keep():
    generator = np.random.default_rng(2)
    world_from_rig = pose((0.0, 3.0, 1.0), roll_deg=-8.0, yaw_deg=200.0)
    points = generator.uniform(-5.0, 5.0, (4000, 3))
    for view in _views(np.inf, world_from_rig):
        x, y, z, w = (points @ view.clip_from_viewpoint[:, :3].T + view.clip_from_viewpoint[:, 3]).T
        drawn = (np.abs(x) <= w) & (np.abs(y) <= w) & (z <= w) & (w > 0.0)
        kept = np.all(
            points @ view.frustum_planes[:, :3].T + view.frustum_planes[:, 3] >= 0.0, axis=1
        )
        assert drawn.any()
        # points on a plane itself do not occur by chance
        assert np.array_equal(drawn, kept)
        assert np.array_equal(drawn, _shown(view, points, np.inf, world_from_rig))


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


def test_clusters_that_face_away_show_no_front_to_the_viewpoint(context):
    """All triangles of all clusters, from viewpoints at random."""
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
    geometry = buffers.static_geometry
    one_sided = ~np.array([batch.material.double_sided for batch in geometry.batches])
    one_sided = one_sided[geometry.batch_of_cluster]
    culler = ClusterCuller(geometry.hierarchy, ~one_sided, geometry.anchor_m, PLAN, samples=1)
    clusters = geometry.clusters
    vertices = np.frombuffer(geometry.vertices.read(), dtype=VERTEX)
    everything = geometry.triangles["vertices"]
    corners_m = vertices["in_position"][everything].astype(np.float64)
    assert len(corners_m) == sum(len(mesh.triangles) for mesh in meshes)
    normals = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    generator = np.random.default_rng(3)
    culled, could_be = 0, 0
    for viewpoint_m in generator.uniform(-3.0, 3.0, (60, 3)):
        centres_m = 0.5 * (clusters.aabb_min + clusters.aabb_max) + (
            geometry.anchor_m - viewpoint_m
        )
        radii_m = 0.5 * np.linalg.norm(clusters.aabb_max - clusters.aabb_min, axis=1)
        distances_m = np.linalg.norm(centres_m, axis=1)
        everything = np.arange(len(radii_m))
        away = culler.faces_away(everything, centres_m.T, distances_m, radii_m)
        corner_m = corners_m[:, 0] + (geometry.anchor_m - viewpoint_m)
        is_front = np.sum(normals * corner_m, axis=1) < 0.0
        has_front = np.logical_or.reduceat(is_front, clusters.first)
        assert not np.any(away & has_front)
        assert np.all(one_sided[away])
        culled += np.count_nonzero(away)
        could_be += np.count_nonzero(~has_front & one_sided)
    # cones and balls are wider than what they hold, of the rough sheet in particular
    assert culled > could_be / 3
