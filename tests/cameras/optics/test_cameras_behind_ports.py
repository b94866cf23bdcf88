"""Every camera model behind windows, by closed forms: a concentric dome, a flat port by Snell."""

import json
import shutil

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.cameras.models.field_of_view import optical_axis
from omnisim.cameras.optics import OpticalSystem
from omnisim.cameras.optics.surface import refractive_index
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.rendering.camera.captured_image import camera_of_parameters
from tests.camera_examples import CAMERA_EXAMPLES, FIRST_EXAMPLES
from tests.cameras.calibration.sample_files import FOLDER
from tests.cameras.optics.examples import behind_a_dome, port

RADIUS_M = 0.5
MODELS = {name: camera for name, camera in CAMERA_EXAMPLES.items() if name in FIRST_EXAMPLES}
each_camera = pytest.mark.parametrize("camera", MODELS.values(), ids=MODELS)


def _pixels(camera):
    grid = pixel_grid(camera.width_px, camera.height_px)
    step = max(1, camera.width_px // 40)
    return grid[::step, ::step].reshape(-1, 2)


@each_camera
def test_a_concentric_dome_bends_no_ray(camera):
    system, pixels = behind_a_dome(camera, RADIUS_M), _pixels(camera)
    own, through = camera.ray_from_pixel(pixels), system.rays(pixels)
    ahead = optical_axis(camera) * own.directions[:, 2] > 1e-6
    np.testing.assert_array_equal(through.valid, own.valid & ahead)
    assert through.valid.sum() > 20
    seen = own.directions[through.valid]
    np.testing.assert_allclose(through.directions[through.valid], seen, atol=1e-12)
    np.testing.assert_allclose(through.origins_m[through.valid], RADIUS_M * seen, atol=1e-12)


@each_camera
def test_points_through_a_concentric_dome_are_where_their_directions_are(camera):
    system, pixels = behind_a_dome(camera, RADIUS_M), _pixels(camera)
    rays = system.rays(pixels)
    seen = rays.valid & (optical_axis(camera) * rays.directions[:, 2] > 0.05)
    expected = camera.pixel_from_ray(rays.directions[seen])
    for found in (
        system.pixel_from_point(1.7 * rays.directions[seen]),
        system.pixel_from_ray(rays.directions[seen]),
    ):
        assert found.valid.all()
        misses = np.abs(found.positions_px - expected.positions_px).max(axis=1)
        assert np.percentile(misses, 99.0) < 1e-7
        assert misses.max() < 1e-4  # a model's own inverse, at the edge of its domain


@each_camera
def test_files_and_other_sizes(camera):
    system, pixels = behind_a_dome(camera, RADIUS_M), _pixels(camera)
    np.testing.assert_array_equal(system.rig_from_optical, camera.rig_from_optical)
    again = camera_of_parameters(json.loads(json.dumps(system.parameters())))
    assert type(again.camera) is type(camera)
    found, expected = again.rays(pixels), system.rays(pixels)
    both = found.valid & expected.valid
    assert (found.valid != expected.valid).mean() < 0.01  # angles are written in degrees
    np.testing.assert_allclose(found.directions[both], expected.directions[both], atol=1e-9)
    large = system.scaled(2.0).rays(2.0 * pixels + 0.5)
    both = large.valid & expected.valid
    assert both.sum() >= 0.98 * expected.valid.sum()
    np.testing.assert_allclose(large.directions[both], expected.directions[both], atol=1e-8)


@each_camera
def test_a_flat_port_bends_by_snell(camera):
    """Seen from the camera's front, if it has one: sines by the media, the azimuth kept."""
    if optical_axis(camera) < 0.0:
        pytest.skip("looks into a mirror: nothing it sees is ahead of it")
    pixels = _pixels(camera)
    own = camera.ray_from_pixel(pixels)
    through = OpticalSystem(camera, port()).rays(pixels)
    air, acrylic, water = (refractive_index(name) for name in ("air", "acrylic", "water"))
    seen = through.valid
    np.testing.assert_array_equal(seen, own.valid & (own.directions[:, 2] > 1e-9))
    across = own.directions[seen, :2]
    np.testing.assert_allclose(through.directions[seen, :2], across * air / water, atol=1e-12)
    within = across * air / acrylic
    outside = 0.05 * across / own.directions[seen, 2:]
    outside = outside + 0.01 * within / np.sqrt(1.0 - np.sum(within**2, axis=1, keepdims=True))
    np.testing.assert_allclose(through.origins_m[seen, :2], outside, rtol=1e-9, atol=1e-12)


def test_a_calibrated_lens(tmp_path):
    """Lens of a calibration file, behind a port."""
    shutil.copy(FOLDER / "kalibr_tum_vi.yaml", tmp_path)
    surface = {"shape": "port", "position_m": [0.0, 0.0, 0.02], "thickness_m": 0.01}
    table = {
        "camera": {"calibration": "kalibr_tum_vi.yaml", "camera": "cam1"},
        "surfaces": [surface | {"medium": "water"}],
    }
    system = parse_optics(table, str(tmp_path / "optics.toml"))
    pixels = _pixels(system)
    assert system.rays(pixels).valid.mean() > 0.3
    again = camera_of_parameters(system.parameters())  # the file is needed no more
    np.testing.assert_array_equal(again.rays(pixels).directions, system.rays(pixels).directions)
