"""Fields of view, against the parameters of the cameras."""

import math

import numpy as np
import pytest

from omnisim.cameras import HyperbolicCamera, PerspectiveCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.models.field_of_view import edge_pixels, field_of_view
from tests.camera_examples import CAMERA_EXAMPLES


def test_mirror():
    mirror = HyperbolicMirror(theta_max_rad=math.radians(105.0))
    found = field_of_view(HyperbolicCamera.framed_on_rim(mirror, 360, 360))
    assert found.axis == (0.0, 0.0, -1.0)
    assert found.covered == pytest.approx(math.pi / 4.0, abs=2e-3)
    assert math.degrees(found.theta_max_rad) == pytest.approx(105.0, abs=1e-9)
    assert math.degrees(found.horizontal_rad) == pytest.approx(210.0, abs=1e-6)
    assert math.degrees(found.diagonal_rad) == pytest.approx(210.0, abs=1e-6)


def test_perspective():
    found = field_of_view(PerspectiveCamera.with_field_of_view(400, 300, math.radians(90.0)))
    assert found.covered == 1.0
    assert math.degrees(found.horizontal_rad) == pytest.approx(90.0, abs=1e-9)
    assert found.vertical_rad == pytest.approx(2.0 * math.atan(0.75), abs=1e-9)
    assert found.diagonal_rad == pytest.approx(2.0 * math.atan(1.25), abs=1e-9)
    assert found.theta_max_rad == pytest.approx(math.atan(1.25), abs=1e-9)
    assert found.theta_limit_rad == pytest.approx(0.5 * math.pi, abs=1e-9)


def test_more_than_180_degrees():
    found = field_of_view(CAMERA_EXAMPLES["equidistant-full-sphere"])
    assert math.degrees(found.horizontal_rad) == pytest.approx(360.0, abs=1e-6)
    assert math.degrees(
        field_of_view(CAMERA_EXAMPLES["cylindrical"]).horizontal_rad
    ) == pytest.approx(360.0, abs=1e-6)


@pytest.mark.parametrize(
    "name",
    ["kannala-brandt-to-its-fold", "double-sphere-tum-vi", "f-theta-to-its-fold", "parabolic"],
)
def test_model_limit(name):
    camera = CAMERA_EXAMPLES[name]
    assert field_of_view(camera).theta_limit_rad == pytest.approx(camera.theta_edge_rad, abs=1e-9)


def test_edge_is_the_last_valid_position():
    camera = CAMERA_EXAMPLES["unified-kitti-360"]
    pixels = edge_pixels(camera, 60)
    assert len(pixels) == 60
    assert camera.ray_from_pixel(pixels).valid.all()
    outwards = pixels - camera.principal_point_px
    beyond = pixels + 1e-6 * outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)
    size = np.array([camera.width_px, camera.height_px])
    inside = np.all((beyond > -0.5) & (beyond < size - 0.5), axis=-1)
    assert 20 < inside.sum() < 60
    assert not camera.ray_from_pixel(beyond[inside]).valid.any()


@pytest.mark.parametrize("center", [(199.5, -0.5), (-30.0, 149.5), (-0.5, -0.5)])
def test_axis_at_the_border_or_beside_the_image(center):
    camera = PerspectiveCamera(400, 300, 200.0, center)
    corner = np.array([399.5, 299.5]) - center
    furthest = max(np.hypot(*corner), np.hypot(corner[0], center[1] + 0.5))
    found = field_of_view(camera)
    assert found.covered == 1.0
    assert math.tan(found.theta_max_rad) == pytest.approx(furthest / 200.0, abs=1e-9)
