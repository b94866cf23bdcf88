"""Lenses that are stretched as real ones are: each pixel has the one ray that projects onto it."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, KannalaBrandtCamera, RationalPolynomialCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import OpticsError
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.scene.model import Mesh
from tests.scenes import ROOM_HALF_M, scene_of

# Of an action camera's lens: Newton's method, started at the radius of the ring at 43.3°, went to
# the axis, and from there back again.
ACTION = KannalaBrandtCamera(
    682, 512, (414.0, 414.6), (336.0, 259.7),
    (0.44339040881523795, -0.279520781256359, 1.1397423685180252, -1.1163347962236474),
)  # fmt: skip


def _lens(seed):
    """Random lens of 64 to 2048 px with strong radial, tangential and thin-prism terms."""
    random = np.random.default_rng(seed)
    width = int(random.choice([64, 96, 128, 200, 256, 360, 512, 720, 1024, 2048]))
    height = int(width * random.choice([1.0, 0.75, 0.5625]))
    focal_px = width * random.uniform(0.3, 0.7)
    focals_px = focal_px, focal_px * random.uniform(0.95, 1.05)
    center_px = tuple(np.array((width, height)) / 2 + random.uniform(-0.05, 0.05, 2) * width)
    if random.random() < 0.5:
        coefficients = tuple(random.uniform(-1.0, 1.0, 4) * (0.5, 0.4, 1.2, 1.2))
        return KannalaBrandtCamera(width, height, focals_px, center_px, coefficients)
    terms = random.normal(size=12) * [0.3, 0.1, 0.01, 0.01, 0.02, 0.3, 0.1, 0.02, *[0.01] * 4]
    terms[5:8] = np.abs(terms[5:8])  # as in real ones, whose radial part has no pole
    count = int(random.choice([8, 12]))
    return RationalPolynomialCamera(width, height, focals_px, center_px, tuple(terms[:count]))


def _lenses(count, largest_px=2048):
    """Random lenses that do not fold at their axis."""
    found, seed = [], 0
    while len(found) < count:
        seed += 1
        try:
            lens = _lens(seed)
        except OpticsError:
            continue
        if lens.width_px <= largest_px:
            found.append(lens)
    return found


def _check_round_trip(lens):
    pixels = pixel_grid(lens.width_px, lens.height_px)
    rays = lens.ray_from_pixel(pixels)
    projected = lens.pixel_from_ray(rays.directions[rays.valid])
    assert projected.valid.all()
    # a pixel's rounding, and what a fold magnifies of it
    np.testing.assert_allclose(projected.positions_px, pixels[rays.valid], atol=1e-6)
    # valid pixels are one region: none is missing inside it
    near = np.pad(rays.valid, 1)
    shape = rays.valid.shape
    neighbors = sum(
        near[1 + y : 1 + y + shape[0], 1 + x : 1 + x + shape[1]].astype(int)
        for y in (-1, 0, 1)
        for x in (-1, 0, 1)
        if x or y
    )
    assert not np.any(~rays.valid & (neighbors >= 7))


def test_every_pixel_is_projected_onto_itself():
    _check_round_trip(ACTION)


@pytest.mark.slow
def test_every_pixel_of_many_lenses_is_projected_onto_itself():
    for lens in _lenses(60, largest_px=360):
        _check_round_trip(lens)


def _wall(center, across, up, cells):
    """Wall of (cells, cells) squares with a mesh of its own, and its pose."""
    grid = np.linspace(-1.0, 1.0, cells + 1)
    points = grid[:, None, None] * across + grid[None, :, None] * up
    index = np.arange((cells + 1) ** 2, dtype=np.uint32).reshape(cells + 1, cells + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3)
    world_from_mesh = np.eye(4)
    world_from_mesh[:3, 3] = center
    return Mesh("wall", points.reshape(-1, 3).astype(np.float32), triangles, 0), world_from_mesh


def _walls(cells):
    """The room's six walls, see `_wall`, with a number of cells each."""
    x, y, z = np.diag(ROOM_HALF_M)
    sides = (-z, x, y), (z, x, y), (-y, x, z), (y, x, z), (-x, y, z), (x, y, z)
    return [_wall(*side, count) for side, count in zip(sides, cells, strict=True)]


def _check_hits(lens, random, rays):
    """Number of rays in a room of six meshes, any way round: each hits what projects onto it."""
    walls = _walls(random.integers(1, 12, 6))
    world_from_room = pose(random.uniform(-5.0, 5.0, 3), **_angles(random))
    placed = [world_from_room @ world_from_mesh for _, world_from_mesh in walls]
    scene = scene_of([mesh for mesh, _ in walls], poses=placed)
    grid = pixel_grid(lens.width_px, lens.height_px)
    pixels = lens.ray_from_pixel(grid)
    count = max(1, min(40, rays // pixels.valid.size))
    room_from_optical = np.stack(
        [pose(random.uniform(-0.9, 0.9, 3) * ROOM_HALF_M, **_angles(random)) for _ in range(count)]
    )
    with Stage(scene) as stage, stage.open(OmniCamera.of(lens)) as camera:
        base_from_optical = camera.camera.base_from_optical
        poses = world_from_room @ room_from_optical @ np.linalg.inv(base_from_optical)
        found = camera.render_batch(poses, channels=("range", "position", "valid"))
    for ranges_m, points_m, valid, viewpoint in zip(
        found["range"], found["position"], found["valid"], room_from_optical, strict=True
    ):
        seen = valid == 1
        assert np.array_equal(seen, pixels.valid)
        ranges_m, world_m = ranges_m[seen], points_m[seen]
        assert np.all(np.isfinite(ranges_m)), (lens, np.argwhere(~np.isfinite(found["range"])))
        room_m = (world_m - world_from_room[:3, 3]) @ world_from_room[:3, :3]
        from_walls_m = np.abs(room_m) - ROOM_HALF_M
        # float32 of some meters
        assert np.abs(from_walls_m.max(axis=-1)).max() < 1e-5
        rays = (room_m - viewpoint[:3, 3]) @ viewpoint[:3, :3]
        projected = lens.pixel_from_ray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))
        # a float32's 3e-7 rad of the GPU's ray, times the focal length
        off_px = np.abs(projected.positions_px - grid[seen]).max(axis=-1)
        assert off_px[projected.valid].max() < 0.01, lens
        assert projected.valid.mean() > 0.99  # beyond the fold's own rounding
    return count * int(pixels.valid.sum())


def _angles(random):
    roll_deg, pitch_deg, yaw_deg = random.uniform(-180.0, 180.0, 3) * (1.0, 0.5, 1.0)
    return {"roll_deg": roll_deg, "pitch_deg": pitch_deg, "yaw_deg": yaw_deg}


def test_rays_of_an_action_camera_hit_the_room_around(needs_opengl):
    small = dataclasses.replace(ACTION, theta_max_rad=math.radians(80.0)).scaled(0.5)
    assert _check_hits(small, np.random.default_rng(1), 180_000) > 80_000


@pytest.mark.parametrize("images", [1, 4], ids=["alone", "in a batch"])
def test_rays_along_a_wall_of_narrow_triangles_hit_it(images, needs_opengl):
    """Also those of its triangles that no texel shows, many edges away from any that one shows."""
    walls = _walls([20] * 6)
    scene = scene_of([mesh for mesh, _ in walls], poses=[placed for _, placed in walls])
    lens = EquidistantCamera(64, 64, 32.0 / math.radians(85.0), (31.5, 31.5))
    # 15 cm below the ceiling, which is seen along 5.7 m
    poses = np.stack([pose((-2.7, 0.5 * k, 1.35), yaw_deg=5.0 * k) for k in range(images)])
    with Stage(scene) as stage, stage.open(OmniCamera.of(lens)) as camera:
        found = camera.render_batch(poses, channels=("position", "valid"))
    from_walls_m = np.abs(found["position"][found["valid"] == 1]) - ROOM_HALF_M
    assert len(from_walls_m) > 3000 * images
    assert np.abs(from_walls_m.max(axis=-1)).max() < 1e-5


@pytest.mark.slow
def test_rays_of_stretched_lenses_hit_the_room_around(needs_opengl):
    random = np.random.default_rng(2)
    assert sum(_check_hits(lens, random, 300_000) for lens in _lenses(8, 512)) > 10**6


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", range(5))
def test_none_of_100_million_rays_misses(seed, needs_opengl):
    """A fifth of them each."""
    random, rays = np.random.default_rng(3 + seed), 0
    lenses = _lenses(30)
    while rays < 2 * 10**7:
        rays += sum(_check_hits(lens, random, 700_000) for lens in lenses)
