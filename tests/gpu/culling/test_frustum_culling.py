"""Frustum culling and screen bounds of boxes, beside points of them, projected one by one."""

import numpy as np
import pytest
from omnisim.gpu.culling.frustum_culling import EDGE_PX, FrustumCuller

from omnisim import poses
from omnisim.cube import FACE_FROM_RIG
from omnisim.gpu.atlas.tile_plan import plan_tiles
from omnisim.gpu.atlas.tile_views import TileViews
from omnisim.sensors import OmniCamera

CAMERA = OmniCamera().resized(200).model
PLAN = plan_tiles(CAMERA, CAMERA.rig_from_optical, subdivide=True)
NEAR_M = 0.05
POINTS = 300  # of each box
POSE = poses.pose((5.0, -2.0, 1.0), roll_deg=14.0, pitch_deg=-30.0, yaw_deg=77.0)
any_far = pytest.mark.parametrize("far_m", [np.inf, 30.0])


def _views(far_m):
    return TileViews(PLAN, NEAR_M, far_m).at(POSE)


def _boxes(count=300, seed=1):
    """Centres and half extents (count, 3) from the viewpoint, of all sizes; some are around it."""
    generator = np.random.default_rng(seed)
    centres_m = generator.uniform(-6.0, 6.0, (count, 3))
    half_extents_m = 10.0 ** generator.uniform(-2.0, 0.3, (count, 3))
    inside = generator.uniform(-1.0, 1.0, (count, POINTS, 3))
    inside[:, :8] = np.array(np.meshgrid((-1, 1), (-1, 1), (-1, 1))).reshape(3, 8).T
    return centres_m, half_extents_m, centres_m[:, None] + inside * half_extents_m[:, None]


def _cull(views, centres_m, half_extents_m, radius_px):
    """Masks (views, n) of boxes in view and of those with bounds, and these bounds."""
    culler, shape = FrustumCuller(views, radius_px), (len(views), len(centres_m))
    view, box = np.divmod(np.arange(np.prod(shape)), shape[1])
    seen, projected = culler.cull(
        view, centres_m[box].T.astype(np.float32), half_extents_m[box].T.astype(np.float32)
    )
    covering, bounds = culler.screen_bounds(projected)
    in_view, bounded = np.zeros((2, *shape), dtype=np.bool_)
    in_view.flat[seen], bounded.flat[seen[covering]] = True, True
    return in_view, bounded, bounds


def _texels(view, points):
    """Texels (..., 2) of points (..., 3) in the atlas, and their mask, by tangents."""
    local = points @ POSE[:3, :3] @ FACE_FROM_RIG[view.tile.face].T
    depth = local[..., 2]
    tangents = local[..., :2] / np.where(depth > NEAR_M, depth, 1.0)[..., None]
    first, last = view.tile.padded_region
    shown = np.all((tangents >= first) & (tangents <= last), axis=-1) & (depth > NEAR_M)
    shares = (tangents - first) / (last - first)
    corner = (view.tile.left_px, view.tile.top_px)
    return corner + shares * view.tile.size_px, shown, depth


@any_far
def test_no_box_is_left_out_of_a_view_that_shows_a_point_of_it(far_m):
    views = _views(far_m)
    assert len(views) >= 5
    centres_m, half_extents_m, points = _boxes()
    in_view, bounded, _ = _cull(views, centres_m, half_extents_m, 0.5 + EDGE_PX)
    shown = np.array([_texels(view, points)[1].any(axis=1) for view in views])
    assert not np.any(shown & ~in_view)
    assert not np.any(shown & ~bounded)
    # small boxes are told apart well: what is kept of them is seen, but for corners and slim cuts
    small = half_extents_m.max(axis=1) < 0.15
    assert in_view[:, small].sum() < 2 * max(shown[:, small].sum(), 1)


@any_far
@pytest.mark.parametrize("radius_px", [EDGE_PX, 0.5 + EDGE_PX])
def test_screen_bounds_cover_all_texels_that_boxes_do(far_m, radius_px):
    """A texel is covered where its middle is, or a sample near it: nothing else is drawn."""
    views = _views(far_m)
    centres_m, half_extents_m, points = _boxes()
    _, bounded, bounds = _cull(views, centres_m, half_extents_m, radius_px)
    first, last = np.zeros((2, *bounded.shape, 2))
    nearest = np.zeros(bounded.shape)
    first[bounded], last[bounded] = bounds.first.T, bounds.last.T
    nearest[bounded] = bounds.nearest
    checked = 0
    for view, here, start, end, depth in zip(views, bounded, first, last, nearest, strict=True):
        texels, shown, distance_m = _texels(view, points)
        texel = np.floor(texels)
        hit = shown & np.all(np.abs(texels - texel - 0.5) <= radius_px, axis=-1)
        covered = np.all((texel >= start[:, None]) & (texel <= end[:, None]), axis=-1)
        assert not np.any(hit & ~(covered & here[:, None]))
        # a depth that is not nearer than what is drawn there
        z = view.clip_from_viewpoint[2] @ np.stack(
            (*np.moveaxis(points, -1, 0), np.ones(points.shape[:2]))
        ).reshape(4, -1)
        drawn = (z.reshape(distance_m.shape) / distance_m)[hit]
        assert np.all(drawn <= np.broadcast_to(depth[:, None], hit.shape)[hit] * (1.0 + 1e-6))
        tile = view.tile
        corner = np.array((tile.left_px, tile.top_px))
        assert np.all(start[here] >= corner)
        assert np.all(end[here] < corner + tile.size_px)
        checked += np.count_nonzero(hit)
    assert checked > 1000


def test_boxes_beyond_the_far_or_before_the_near_plane_are_culled():
    views = _views(30.0)
    forward = views[0].clip_from_viewpoint[3, :3]  # a row of the matrix: w is the distance along it
    ahead_m = np.array([-1.0, 0.02, 0.08, 5.0, 29.0, 31.0, 40.0])[:, None] * forward
    sides = np.full((len(ahead_m), 3), 0.01)
    face = [view for view in views if view.tile.face == views[0].tile.face]
    in_view, *_ = _cull(face, ahead_m, sides, EDGE_PX)
    assert in_view[:, 2:5].any(axis=0).all()
    assert not in_view[:, [0, 1, 5, 6]].any()
    large, *_ = _cull(face, ahead_m[-2:], np.array([[2.0] * 3, [2.0] * 3]), EDGE_PX)
    assert large.any(axis=0).tolist() == [True, False]


def test_boxes_between_the_centres_of_texels_are_culled():
    """One sample per texel: a box as small as a tenth of a texel is mostly missed."""
    views = _views(np.inf)
    generator = np.random.default_rng(4)
    centres_m = generator.uniform(-1.0, 1.0, (2000, 3))
    centres_m *= 20.0 / np.linalg.norm(centres_m, axis=1, keepdims=True)
    half_extents_m = np.full_like(centres_m, 0.005)
    in_view, one, _ = _cull(views, centres_m, half_extents_m, EDGE_PX)
    _, several, _ = _cull(views, centres_m, half_extents_m, 0.5 + EDGE_PX)
    assert in_view.sum() > 1000
    # at least a quarter texel to a side is covered, as edges are rounded
    assert 0.04 < one.sum() / in_view.sum() < 0.4
    assert several.sum() > 0.9 * in_view.sum()


def test_screen_bounds_are_tight():
    """Nothing else than boxes' corners makes them larger than what is seen of many points."""
    views = _views(np.inf)
    centres_m, half_extents_m, points = _boxes(seed=3)
    small = (half_extents_m.max(axis=1) < 0.3) & (np.linalg.norm(centres_m, axis=1) > 2.0)
    centres_m, half_extents_m, points = centres_m[small], half_extents_m[small], points[small]
    _, bounded, bounds = _cull(views, centres_m, half_extents_m, EDGE_PX)
    sizes = np.zeros((*bounded.shape, 2))
    sizes[bounded] = (bounds.last - bounds.first + 1).T
    for view, size in zip(views, sizes, strict=True):
        texels, shown, _ = _texels(view, points)
        whole = shown.all(axis=1)
        extent = texels[whole].max(axis=1) - texels[whole].min(axis=1)
        assert np.all(size[whole] <= extent + 1.0 + 2.0 * EDGE_PX)
