"""Lenses as sensors: by a sensor file, rendered, resized, and mounted on a robot."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, HyperbolicCamera, pixel_grid
from omnisim.core import poses
from omnisim.core.errors import OpticsError, SensorFileError
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from tests.camera_examples import OWN, camera_examples

LENS = EquidistantCamera(320, 240, 90.0, (160.25, 118.5), math.radians(100.0))
TEXT = """
[lens]
model = "equidistant"
width_px = 320
height_px = 240
focal_length_px = 90.0
principal_point_px = [160.25, 118.5]
theta_max_deg = 100.0
[lens.mounting]
position_m = [0.1, 0.2, 0.3]
pitch_deg = 10.0
[camera]
supersampling = 1
"""


def test_lens_from_a_sensor_file(tmp_path):
    (tmp_path / "lens.toml").write_text(TEXT)
    sensor = OmniCamera.from_file(tmp_path / "lens.toml")
    assert sensor.model == LENS
    assert sensor.polygons is None
    assert sensor.supersampling == 1
    np.testing.assert_allclose(sensor.base_from_rig, poses.pose((0.1, 0.2, 0.3), pitch_deg=10.0))
    # it looks the way the vehicle goes
    np.testing.assert_allclose(
        OmniCamera(LENS, polygons=None).base_from_optical[:3, 2], (1.0, 0.0, 0.0)
    )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("equidistant", "equidistand", r"lens\.model: expected one of .*, got 'equidistand'"),
        ("focal_length_px = 90.0\n", "", r"lens\.focal_length_px: missing$"),
        (
            "focal_length_px = 90.0\nprincipal_point_px = [160.25, 118.5]\n",
            "",
            r"lens\.focal_length_px, principal_point_px: missing$",
        ),
        ("90.0", "'90'", r"lens\.focal_length_px: expected a number, got '90'"),
        ("theta_max_deg", "theta_deg", r"theta_deg: unknown key; did you mean 'theta_max_deg'\?"),
        ("\nfocal", "\nk5 = 1\nfocal", r"lens\.k5: unknown key; expected one of model"),
        ("[camera]", "[mirror]\nk = 5.0\n[camera]", r"\[lens\] and \[mirror\] both define"),
        ("[camera]", "[camera]\nwidth_px = 9", r"camera\.width_px: expected it in \[lens\]"),
        ("theta_max_deg = 100.0", "theta_max_deg = 200.0", r"lens\.theta_max"),
    ],
)
def test_bad_lenses_are_named(tmp_path, old, new, words):
    (tmp_path / "lens.toml").write_text(TEXT.replace(old, new))
    with pytest.raises(SensorFileError, match=r"lens\.toml: .*" + words) as info:
        OmniCamera.from_file(tmp_path / "lens.toml")
    assert "\n" not in str(info.value)


def test_a_lens_has_no_mesh():
    assert OmniCamera(LENS).mesh_polygons is None
    assert OmniCamera(LENS).mesh_error_px == 0.0
    message = "model 'equidistant' has no mirror with a mesh: expected 'auto' or 'exact'"
    with pytest.raises(OpticsError, match=message):
        OmniCamera(LENS, polygons=1024)


@camera_examples
def test_scaled_model_has_the_same_rays(camera):
    """Resizing of every model: each knows its lengths in pixels."""
    large = camera.scaled(2.0)
    assert (large.width_px, large.height_px) == (2 * camera.width_px, 2 * camera.height_px)
    pixels = pixel_grid(camera.width_px, camera.height_px)[::11, ::13]
    one, other = camera.ray_from_pixel(pixels), large.ray_from_pixel(2.0 * pixels + 0.5)
    both = one.valid & other.valid
    assert both.sum() >= 0.98 * one.valid.sum()
    np.testing.assert_allclose(one.directions[both], other.directions[both], atol=1e-9)


@camera_examples
def test_sensor_toml_round_trip_of_every_model(camera, tmp_path):
    sensor = OmniCamera(camera, polygons=None)
    (tmp_path / "s.toml").write_text(sensor.to_toml())
    again = OmniCamera.from_file(tmp_path / "s.toml")
    assert type(again.model) is type(camera)
    if not isinstance(camera, HyperbolicCamera):
        pixels = pixel_grid(camera.width_px, camera.height_px)[::9, ::9]
        np.testing.assert_allclose(
            again.model.ray_from_pixel(pixels).directions,
            camera.ray_from_pixel(pixels).directions,
            atol=1e-12,
        )
    assert dataclasses.replace(again, model=camera).supersampling == sensor.supersampling


@pytest.mark.usefixtures("needs_opengl")
def test_own_models_are_drawn_by_both_back_ends_and_in_batches():
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    at, found = poses.pose((0.2, -0.3, 1.1), yaw_deg=20.0), []
    for backend in ("cube", "rays"):
        with open_sensor("rings", OWN, backend=backend) as renderer:
            frame = renderer.render(at, also=("range",))
            assert np.array_equal(renderer.render_batch(np.stack([at, at]))[1], frame.rgb)
            found.append(frame)
    cube, rays = found
    assert np.array_equal(cube.valid, rays.valid)
    assert cube.valid.mean() > 0.5
    seen = np.isfinite(rays.channels["range"])
    near = np.isclose(cube.channels["range"][seen], rays.channels["range"][seen], rtol=1e-4)
    assert near.mean() > 0.98  # all but edges
    apart = np.abs(cube.rgb.astype(int) - rays.rgb)[cube.valid]
    assert np.median(apart) <= 1.0  # without the edges of the rings
