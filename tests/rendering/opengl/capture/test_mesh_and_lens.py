"""The GPU's rays against NumPy's, and the mesh's against the exact mirror's."""

import numpy as np
import pytest

from omnisim.cameras import HyperbolicCamera, MirroredCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.mirror_mesh import mesh_error
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from tests.camera_examples import OWN, camera_examples


def _angles(one, other):
    """Angles between unit vectors; by the chord, which is exact where the arccosine is not."""
    return 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=-1), 0.0, 1.0))


@camera_examples
def test_glsl_rays_are_the_reference(context, camera):
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


@pytest.mark.parametrize("polygons", [16, 64, 256, 1024, 4096])
def test_mesh_error_is_the_one_computed_without_a_gpu(context, polygons):
    mirror = HyperbolicMirror()
    computed = mesh_error(mirror, polygons, 180.0)
    error = _mesh_error_px(context, polygons)
    # the computation samples the area evenly, an image its pixels; the GPU counts in 1/256 px
    assert error.mean() == pytest.approx(computed.mean_px, rel=0.02)
    assert error.max() == pytest.approx(computed.max_px, rel=0.02)


def test_paper_mesh_is_within_the_stated_bound(context):
    error = _mesh_error_px(context, 1024)
    assert error.mean() <= 0.20
    assert error.max() <= 0.40


def test_four_times_the_polygons_a_quarter_of_the_error(context):
    means = [_mesh_error_px(context, polygons).mean() for polygons in (64, 256, 1024, 4096)]
    slope = np.polyfit(np.log([64, 256, 1024, 4096]), np.log(means), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.05)
