"""Rays of pixels, the mesh that is chosen for an image, and the pixels that are valid."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim import OmniCamera, open_sensor
from omnisim.cameras import EquidistantCamera, HyperbolicCamera, PerspectiveCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.hyperbolic import inside_rim
from omnisim.cameras.mirrors.mirror_mesh import sectors_and_rings
from omnisim.core.errors import OpticsError
from omnisim.core.poses import pose
from omnisim.rendering.camera.captured_image import valid_mask
from omnisim.rendering.camera.quality import MAX_ERROR_PX, auto_polygons, mesh_error_px
from omnisim.rendering.opengl.capture import image_pass
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.pixel_rays import PixelRays
from tests.camera_examples import POLE
from tests.cameras.optics.examples import SYSTEMS
from tests.rendering.frames import BACKENDS, frame_of, opened
from tests.scenes import room, scene_of

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

SMALL_MIRROR = OmniCamera().resized(90)
FISHEYE = OmniCamera(
    EquidistantCamera(80, 70, 25.0, (39.5, 34.5), math.radians(95.0)), polygons=None
)


def _whole(rays):
    """Rays (height, width, 3), their validity, and their steps (height, width, 2, 3)."""
    shape = rays.camera.height_px, rays.camera.width_px
    directions, valid, steps = (
        np.zeros((*shape, 3)),
        np.zeros(shape, bool),
        np.zeros((*shape, 2, 3)),
    )
    for number, rows in enumerate(rays.bands):
        band = rays.band(number)
        valid[rows] = band.valid
        directions[rows][band.valid] = band.directions
        steps[rows][band.valid] = band.footprints
    return directions, valid, steps


@pytest.mark.parametrize("polygons", [None, 64, 1024])
def test_rays_are_those_of_the_gpu(context, polygons):
    camera = SMALL_MIRROR.with_polygons(polygons).model
    theirs, their_valid = PixelMap(context, camera, polygons).read_rays()
    mine, valid, _ = _whole(PixelRays(camera, polygons))
    # along the outline a rounding decides
    assert (valid != their_valid).sum() <= 4
    both = valid & their_valid
    assert np.abs(mine - theirs)[both].max() < 2e-6


@pytest.mark.parametrize("sensor", [SMALL_MIRROR, FISHEYE])
def test_steps_are_those_to_the_next_samples(sensor):
    camera = sensor.model.scaled(2)
    directions, valid, steps = _whole(PixelRays(camera, None, 2))
    pixels = pixel_grid(camera.width_px, camera.height_px)
    for axis, offset in enumerate(((1.0, 0.0), (0.0, 1.0))):
        beside = camera.ray_from_pixel(pixels + offset)
        there = valid & beside.valid
        assert there.mean() > 0.5
        expected = (beside.directions - directions)[there]
        np.testing.assert_allclose(steps[..., axis, :][there], expected, atol=1e-7)
        # at the right and lower border of what is valid, as long as the step before
        lengths = np.linalg.norm(steps[..., axis, :], axis=-1)
        assert (lengths[valid] > 0.0).mean() > 0.99


def test_bands_end_where_pixels_do():
    rays = PixelRays(OmniCamera().model.scaled(3), None, 3)
    assert len(rays.bands) > 10
    assert all(rows.start % 3 == 0 for rows in rays.bands)
    assert rays.bands[-1].stop == rays.camera.height_px


PAPER = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 360, 360)
HIGH_RIM = HyperbolicCamera.framed_on_rim(HyperbolicMirror(theta_max_rad=2.6), 300, 300)
CAMERAS = {
    "paper": PAPER,
    "off its axis": dataclasses.replace(PAPER, principal_point_px=(31.3, 402.9)),
    "axis far outside": dataclasses.replace(PAPER, principal_point_px=(-150.0, 180.0)),
    "cropped": dataclasses.replace(PAPER, focal_length_px=6.0 * PAPER.focal_length_px),
    "wide": HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 500, 90),
    "to its asymptote": HIGH_RIM,
    "plane": HyperbolicCamera.framed_on_rim(
        HyperbolicMirror(k=2.0, theta_max_rad=math.radians(40.0)), 200, 200
    ),
    "a few pixels": PAPER.scaled(5 / 360),
}
cameras = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())


def _off_px(context, camera, polygons):
    """Distances (n,) of pixels with a ray from where the exact mirror shows it, and (m,) of others
    from the principal point."""
    rays, seen = PixelMap(context, camera, polygons).read_rays()
    positions_px = pixel_grid(camera.width_px, camera.height_px) - camera.principal_point_px
    shown_px = _shown_px(camera, rays[seen].astype(np.float64))
    off_px = np.linalg.norm(shown_px - positions_px[seen], axis=1)
    return off_px, np.linalg.norm(positions_px[~seen], axis=1)


def _shown_px(camera, rays):
    """Positions (n, 2), from the principal point, where the exact mirror shows rays (n, 3)."""
    theta = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2])
    # not `pixel_from_ray`, which ends at the rim: a mesh shows a little more
    radii_px = camera.focal_length_px * camera.mirror.tangent_from_theta(theta)
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    return np.stack((np.cos(azimuth), np.sin(azimuth)), axis=-1) * radii_px[:, None]


@pytest.mark.parametrize(
    ("camera", "supersampling"),
    [*((camera, 1) for camera in CAMERAS.values()), (PAPER, 2), (CAMERAS["cropped"], 2)],
)
def test_rays_of_the_gpu_are_right_to_a_tenth_of_a_pixel(context, camera, supersampling):
    fine = camera.scaled(supersampling)
    off_px, unseen_radii_px = _off_px(context, fine, auto_polygons(camera))
    assert off_px.max() / supersampling < MAX_ERROR_PX
    lost_px = fine.rim_radius_px - unseen_radii_px
    assert lost_px.max(initial=0.0) / supersampling < MAX_ERROR_PX


@cameras
def test_stated_error_is_that_of_the_gpu(context, camera):
    """No pixel is off by more than is said."""
    for polygons in (16, 1024):
        stated_px = mesh_error_px(camera, polygons)
        off_px, _ = _off_px(context, camera, polygons)
        assert off_px.max() < stated_px


def test_larger_images_need_more_polygons_and_cropped_ones_fewer():
    counts = [OmniCamera().resized(size_px).mesh_polygons for size_px in (90, 360, 1024, 4096)]
    assert counts == [900, 3600, 10000, 40000]
    middle = dataclasses.replace(PAPER, width_px=36, height_px=36, principal_point_px=(17.5, 17.5))
    assert auto_polygons(middle) < 3600


def test_choice_follows_every_change_of_the_sensor():
    sensor = OmniCamera()
    assert (sensor.polygons, sensor.mesh_polygons) == ("auto", 3600)
    assert sensor.with_quality("fast").mesh_polygons == 3600
    assert sensor.resized(1024).resized(360).mesh_polygons == 3600
    assert sensor.with_polygons(1024).mesh_polygons == 1024
    assert sensor.with_polygons(None).mesh_polygons is None
    assert sensor.with_polygons(1024).with_polygons("auto").mesh_polygons == 3600
    assert OmniCamera.of(PAPER).polygons == "auto"
    assert OmniCamera.of(PerspectiveCamera(8, 8, 5.0, (3.5, 3.5))).mesh_polygons is None
    with pytest.raises(OpticsError, match="polygons: expected a whole number, 'auto' or None"):
        OmniCamera(polygons="many")


def test_words_say_what_was_chosen_and_why():
    assert "3600 polygons (auto)" in repr(OmniCamera())
    assert repr(OmniCamera(polygons=64)).endswith("64 polygons)")
    assert OmniCamera(polygons=None).mesh_summary == "exact"
    close_up = dataclasses.replace(PAPER, focal_length_px=1e7)
    too_fine = OmniCamera(close_up)
    assert too_fine.mesh_polygons is None
    assert too_fine.mesh_error_px == 0.0
    assert too_fine.mesh_summary == "exact (auto: 0.1 px need more than 1048576 polygons)"


def test_valid_pixels_are_those_of_the_exact_mirror_but_for_a_tenth_of_a_pixel():
    sensor = OmniCamera()
    exact, mesh = (valid_mask(PAPER, polygons) for polygons in (None, sensor.mesh_polygons))
    assert not (mesh & ~exact).any()
    radii_px = np.linalg.norm(pixel_grid(360, 360) - PAPER.principal_point_px, axis=-1)
    assert (PAPER.rim_radius_px - radii_px[exact & ~mesh] < MAX_ERROR_PX).all()


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(("polygons", "bound_px"), [("auto", MAX_ERROR_PX), (None, 1e-3)])
def test_ground_truth_lies_on_the_rays_of_the_exact_camera(polygons, bound_px):
    """Points of the scene, put through the exported camera, come back to their pixels."""
    sensor = OmniCamera(polygons=polygons, supersampling=1, face_size_px=256).resized(240)
    world_from_base = pose((0.3, -0.4, 0.1), roll_deg=12.0, pitch_deg=-20.0, yaw_deg=33.0)
    with open_sensor(scene_of([room()]), sensor) as renderer:
        frame = renderer.render(world_from_base, also=("position", "valid"))
    valid = frame.channels["valid"] > 0
    optical_from_world = np.linalg.inv(world_from_base @ sensor.base_from_optical)
    points_m = frame.channels["position"][valid] @ optical_from_world[:3, :3].T
    seen = sensor.model.pixel_from_ray(points_m + optical_from_world[:3, 3])
    off_px = np.linalg.norm(seen.positions_px - pixel_grid(240, 240)[valid], axis=1)
    assert off_px[seen.valid].max() < bound_px
    assert seen.valid.mean() > 0.995  # on the rim a mesh's edge shows a little more


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
@pytest.mark.parametrize("supersampling", [2, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("sensor", list(_cases()))
def test_all_show_the_pixels_that_numpy_finds(sensor, supersampling, monkeypatch):
    sensor = dataclasses.replace(sensor, supersampling=supersampling)
    with_ray, shown = _expected(sensor)
    for backend in BACKENDS:
        with opened(scene_of([room()]), sensor, backend) as camera:
            frame = camera.render(HERE, also=("valid", "range"))
            batch = camera.render_batch([HERE, HERE], channels=("rgba", "valid", "range"))
        np.testing.assert_array_equal(frame.valid, shown)
        np.testing.assert_array_equal(batch["rgba"][..., 3] > 0, [shown] * 2)
        np.testing.assert_array_equal(frame.channels["valid"] > 0, with_ray)
        np.testing.assert_array_equal(batch["valid"] > 0, [with_ray] * 2)
        for ranges_m in (frame.channels["range"], *batch["range"]):
            np.testing.assert_array_equal(np.isfinite(ranges_m), with_ray)
    monkeypatch.setattr(image_pass, "fits_table", lambda _: False)
    np.testing.assert_array_equal(frame_of(scene_of([room()]), sensor, HERE).valid, shown)


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
