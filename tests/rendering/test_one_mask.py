"""Valid pixels are those of NumPy, in images, ground truth and batches of either back end."""

import dataclasses

import numpy as np
import pytest

from omnisim import OmniCamera, Stage
from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.hyperbolic import inside_rim
from omnisim.cameras.mirrors.mirror_mesh import sectors_and_rings
from omnisim.core.poses import pose
from omnisim.rendering.camera.captured_image import valid_mask
from omnisim.rendering.opengl.capture import image_pass
from tests.camera_examples import POLE
from tests.cameras.optics.examples import SYSTEMS
from tests.scenes import room, scene_of

HERE = pose((0.3, -0.2, 0.1), roll_deg=10.0, yaw_deg=30.0)


def _through_centers(radius_px, size_px=81, center_px=40.0):
    """A mirror whose rim passes through centers of pixels."""
    mirror = HyperbolicMirror()
    focal_px = radius_px / float(mirror.tangent_from_theta(mirror.theta_max_rad))
    return HyperbolicCamera(size_px, size_px, focal_px, (center_px, center_px), mirror)


MIRRORS = {
    f"{kind}, rim of {radius_px:g} px": (camera, polygons)
    for kind, polygons, radius_px, camera in (
        ("exact", None, 25.0, _through_centers(25.0)),
        ("exact", None, 32.5, _through_centers(32.5)),
        ("mesh", 64, 12.5, _through_centers(12.5, 50, 24.5)),
        ("fine mesh", 1024, 25.0, _through_centers(25.0)),
    )
}


def _cases():
    for name, (camera, polygons) in MIRRORS.items():
        yield pytest.param(OmniCamera(camera, polygons=polygons), id=name)
    yield pytest.param(OmniCamera(POLE, polygons=None), id="pole")
    yield pytest.param(OmniCamera(SYSTEMS["sphere"]).resized(60), id="optics")


def _expected(sensor):
    """Pixels with a ray, and those of the image: at least half of their samples have one."""
    model, side = sensor.model, sensor.supersampling
    samples = valid_mask(sensor.supersampled_model, sensor.mesh_polygons)
    shares = samples.reshape(model.height_px, side, model.width_px, side).mean(axis=(1, 3))
    return valid_mask(model, sensor.mesh_polygons), shares >= 0.5


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("supersampling", [1, 2])
@pytest.mark.parametrize("sensor", list(_cases()))
def test_all_show_the_pixels_that_numpy_finds(sensor, supersampling, monkeypatch):
    sensor = dataclasses.replace(sensor, supersampling=supersampling)
    with_ray, shown = _expected(sensor)
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    for backend in ("cube", "rays"):
        with Stage(scene_of([room()]), backend=backend) as stage, stage.open(sensor) as camera:
            frame = camera.render(HERE, also=("valid", "range"))
            batch = camera.render_batch([HERE, HERE], channels=("rgba", "valid", "range"))
        np.testing.assert_array_equal(frame.valid, shown)
        np.testing.assert_array_equal(batch["rgba"][..., 3] > 0, [shown] * 2)
        np.testing.assert_array_equal(frame.channels["valid"] > 0, with_ray)
        np.testing.assert_array_equal(batch["valid"] > 0, [with_ray] * 2)
        for ranges_m in (frame.channels["range"], *batch["range"]):
            np.testing.assert_array_equal(np.isfinite(ranges_m), with_ray)
    monkeypatch.setattr(image_pass, "fits_table", lambda _: False)
    with Stage(scene_of([room()])) as stage, stage.open(sensor) as camera:
        np.testing.assert_array_equal(camera.render(HERE).valid, shown)


def test_a_meshs_rim_is_the_polygon_of_its_sectors():
    """By the corners of the polygon, one triangle after another."""
    camera = _through_centers(25.0)
    for polygons in (16, 64, 1024):
        sectors, _ = sectors_and_rings(polygons)
        azimuths = np.arange(sectors + 1) * (2.0 * np.pi / sectors)
        corners = camera.rim_radius_px * np.stack((np.cos(azimuths), np.sin(azimuths)), axis=1)
        pixels = pixel_grid(81, 81) - camera.principal_point_px
        edges, ahead = corners[1:] - corners[:-1], pixels[..., None, :] - corners[:-1]
        sides = edges[:, 0] * ahead[..., 1] - edges[:, 1] * ahead[..., 0]
        away = np.abs(sides).min(axis=-1) > 1e-9  # on an edge rounding decides
        inside = inside_rim(camera, sectors, pixel_grid(81, 81))
        np.testing.assert_array_equal(inside[away], (sides > 0.0).all(axis=-1)[away])
        assert inside.sum() > 1000
