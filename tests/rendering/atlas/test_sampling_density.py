"""Regions of faces, beside brute force over the pixels that see them."""

from functools import cache

import numpy as np
import pytest

from omnisim import OmniCamera
from omnisim.core.cube import face_index, face_tangents
from omnisim.rendering.atlas.sampling_density import MAX_ANISOTROPY
from omnisim.rendering.atlas.tile_plan import MAX_TILES, plan_tiles, sensor_tiles
from tests.camera_examples import CAMERA_EXAMPLES

examples = pytest.mark.parametrize("name", CAMERA_EXAMPLES)
STEP_PX = 1e-3  # for derivatives
# The finest place may be at a rim between two samples of the face, 1/32 of a tangent apart; there
# is 1 % to spare for it, which the steepest rims of the examples exceed by as much again.
MIN_DENSITY = 0.98
# Of the paper's mirror: of the virtual cameras for each pixel of the mirror, at the fast setting
MAX_TEXELS = 3.7


@cache
def _plan(name, subdivide=True):
    camera = CAMERA_EXAMPLES[name]
    return plan_tiles(camera, camera.rig_from_optical, subdivide=subdivide)


def _lookups(camera, count=4000):
    """Rays of random pixels: face (n,), tangents (n, 2), pixels to a tangent of 1 (n,)."""
    generator = np.random.default_rng(0)
    size = np.array([camera.width_px, camera.height_px])
    pixels = generator.uniform(-0.5, size - 0.5, (count, 2))
    steps = np.array([[0.0, 0.0], [STEP_PX, 0.0], [0.0, STEP_PX]])
    rays = camera.ray_from_pixel(pixels[:, None] + steps)
    valid = rays.valid.all(axis=1)
    rig = rays.directions[valid] @ camera.rig_from_optical.T
    faces = face_index(rig[:, 0])
    tangents = face_tangents(rig, np.repeat(faces[:, None], 3, axis=1))
    by_pixel = np.moveaxis(tangents[:, 1:] - tangents[:, :1], 1, 2) / STEP_PX
    longest, shortest = np.linalg.svd(by_pixel, compute_uv=False).T
    return faces, tangents[:, 0], np.minimum(1.0 / shortest, MAX_ANISOTROPY / longest)


def _tiles_of(plan, faces, tangents):
    """Mask (n, tiles) of the rays (n,) in each tile's region."""
    cores = np.array([tile.region for tile in plan.tiles])
    own = faces[:, None] == np.array([tile.face for tile in plan.tiles])
    at = tangents[:, None]
    return own & np.all((at >= cores[:, 0]) & (at <= cores[:, 1]), axis=-1)


@examples
def test_every_lookup_is_in_one_region_that_is_dense_enough_and_padded(name):
    camera = CAMERA_EXAMPLES[name]
    faces, tangents, finest = _lookups(camera)
    plan = _plan(name)
    assert len(plan.tiles) <= MAX_TILES
    tiles = _tiles_of(plan, faces, tangents)
    assert np.all(tiles.sum(axis=1) == 1)
    tile = np.argmax(tiles, axis=1)
    half_px = 0.5 * np.array([one.face_size_px for one in plan.tiles])[tile]
    assert np.all(half_px >= MIN_DENSITY * finest)
    # what a lookup mixes is drawn: a texel of the coarsest level around it, but for rounding
    spare = (1 << plan.max_level) / half_px[:, None] - 1e-9
    windows = np.array([tile.padded_region for tile in plan.tiles])[tile]
    assert np.all((tangents - spare >= windows[:, 0]) & (tangents + spare <= windows[:, 1]))


@examples
def test_parts_take_no_more_texels_than_whole_faces(name):
    whole, parts = _plan(name, subdivide=False), _plan(name)
    assert parts.texels <= whole.texels
    assert {tile.face for tile in parts.tiles} == {tile.face for tile in whole.tiles}


@pytest.mark.parametrize(
    ("name", "most"),
    [("hyperbolic-paper", 0.7), ("perspective-wide", 0.4), ("equirectangular", 0.6)],
)
def test_parts_spare_much_where_a_image_is_fine_here_and_coarse_there(name, most):
    whole, parts = _plan(name, subdivide=False), _plan(name)
    assert parts.texels < most * whole.texels


def test_cores_do_not_overlap():
    """Two tiles of a face share an edge at most."""
    plan = _plan("equirectangular")
    pairs = [(a, b) for i, a in enumerate(plan.tiles) for b in plan.tiles[:i] if a.face == b.face]
    assert pairs
    for one, other in pairs:
        first = np.maximum(one.region[0], other.region[0])
        last = np.minimum(one.region[1], other.region[1])
        assert np.any(last <= first)


@pytest.mark.parametrize("polygons", [None, 64, 4096])
def test_the_papers_camera_draws_few_texels_for_a_pixel(polygons):
    sensor = OmniCamera(polygons=polygons).with_quality("fast")
    density = sensor.texels_per_pixel / sensor.supersampling
    plan = sensor_tiles(sensor, sensor.supersampled_model, density, subdivide=True)
    rim_px = 0.5 * sensor.model.width_px
    assert 1.0 < plan.texels / (np.pi * rim_px**2) <= MAX_TEXELS
