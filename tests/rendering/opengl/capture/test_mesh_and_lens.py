"""The GPU's rays against NumPy's, the mesh's against the exact mirror's, and the pixels covered."""

import numpy as np
import pytest

from omnisim.cameras import HyperbolicCamera, MirroredCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.mirror_mesh import mesh_error
from omnisim.rendering.opengl.capture.mesh_and_lens import STRIP_PX, PixelMap, covering_triangles
from tests.camera_examples import OWN, camera_examples


def _angles(one, other):
    """Angles between unit vectors; by the chord, which is exact where the arccosine is not."""
    return 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=-1), 0.0, 1.0))


@camera_examples
def test_glsl_rays_are_the_reference(context, camera):
    camera = camera.scaled(0.5) if camera.width_px > 400 else camera
    rays, valid = PixelMap(context, camera).read_rays()
    reference = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    assert np.array_equal(valid, reference.valid)
    # at a fold the ray turns infinitely fast with the pixel
    away = ~_at_the_edge_of_the_domain(camera)
    assert _angles(rays, reference.directions)[valid & away].max() < 1e-5


@pytest.mark.parametrize("camera", [OWN, MirroredCamera(OWN)], ids=["lens", "mirrored"])
def test_own_models_have_the_rays_of_numpy(context, camera):
    rays, valid = PixelMap(context, camera).read_rays()
    reference = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    assert np.array_equal(valid, reference.valid)
    assert _angles(rays, reference.directions)[valid].max() < 1e-6  # float32


def _at_the_edge_of_the_domain(camera, within_px=0.01):
    pixels = pixel_grid(camera.width_px, camera.height_px)
    steps = within_px * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    around = camera.ray_from_pixel(pixels[..., None, :] + steps).valid
    return around.any(axis=-1) & ~around.all(axis=-1)


def _mesh_error_px(context, polygons):
    camera = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 360, 360)
    rays, seen = PixelMap(context, camera, polygons).read_rays()
    assert 0.85 < seen.sum() / camera.ray_from_pixel(pixel_grid(360, 360)).valid.sum() <= 1.0
    # the mesh may see a little past the rim: between two vertices it is nearer to the axis
    theta = np.arccos(np.clip(-rays[seen][:, 2].astype(np.float64), -1.0, 1.0))
    azimuth = np.arctan2(rays[seen][:, 1], rays[seen][:, 0])
    radius = camera.focal_length_px * camera.mirror.tangent_from_theta(theta)
    positions = np.stack((np.cos(azimuth), np.sin(azimuth)), axis=-1) * radius[:, None]
    pixels = pixel_grid(360, 360)[seen] - camera.principal_point_px
    return np.linalg.norm(positions - pixels, axis=-1)


def test_mesh_error_is_the_one_computed_without_a_gpu(context):
    """Four times the polygons have a quarter of the error; the paper's have less than is stated."""
    counts, means = (64, 256, 1024, 4096), []
    for polygons in (16, *counts):
        computed = mesh_error(HyperbolicMirror(), polygons, 180.0)
        error_px = _mesh_error_px(context, polygons)
        means.append(error_px.mean())
        # the computation samples the area evenly, an image its pixels; the GPU counts in 1/256 px
        assert means[-1] == pytest.approx(computed.mean_px, rel=0.02)
        assert error_px.max() == pytest.approx(computed.max_px, rel=0.02)
        assert polygons != 1024 or (means[-1] <= 0.20 and error_px.max() <= 0.40)
    slope = np.polyfit(np.log(counts), np.log(means[1:]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.05)


def _covered(triangles, shape):
    """Count of the triangles (n, 3, 2) that each pixel's center is in; none may lie on an edge."""
    x, y = np.meshgrid(np.arange(shape[1]) + 0.5003, np.arange(shape[0]) + 0.5001)
    count = np.zeros(shape, dtype=int)
    for corners in triangles:
        sides = []
        for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            sides.append((bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0)
        count += np.all(sides, axis=0) | ~np.any(sides, axis=0)
    return count


def _disc(height, width, radius):
    y, x = np.mgrid[:height, :width]
    return (x - width / 2) ** 2 + (y - height / 2) ** 2 < radius**2


NOISE = np.random.default_rng(2).random((37, 53)) < 0.004
MASKS = {
    "disc": _disc(60, 80, 25.0),
    "disc past the image": _disc(61, 43, 35.0),
    "everything": np.ones((19, 23), dtype=bool),
    "one corner": np.pad(np.ones((1, 1), dtype=bool), ((20, 0), (30, 0))),
    "noise": NOISE,
}


@pytest.mark.parametrize("valid", MASKS.values(), ids=MASKS.keys())
def test_every_valid_pixel_is_covered_once(valid):
    corners = covering_triangles(valid)
    assert corners.min() >= 0.0
    assert np.all(corners.max(axis=0) <= valid.shape[::-1])
    count = _covered(corners.reshape(-1, 3, 2), valid.shape)
    assert np.all(count[valid] == 1)
    assert count.max() == 1  # nothing is drawn twice
    # rows without anything are not covered, if there are enough of them
    for top in range(0, len(valid), STRIP_PX):
        if not valid[top : top + STRIP_PX].any():
            assert not count[top : top + STRIP_PX].any()


def test_a_disc_is_covered_closely():
    """A strip is as wide as the disc is in the widest of them."""
    valid = _disc(400, 500, 190.0)
    count = _covered(covering_triangles(valid).reshape(-1, 3, 2), valid.shape)
    # each of four quarters is a staircase with treads of a strip: half a strip at each side of it
    assert count.sum() <= valid.sum() + 4 * 190 * STRIP_PX


def test_nothing_valid_takes_nothing():
    assert covering_triangles(np.zeros((30, 20), dtype=bool)).shape == (0, 2)
