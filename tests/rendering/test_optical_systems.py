"""Images and ground truth of optical systems without one viewpoint, by formulas."""

import dataclasses
import math
import sys

import numpy as np
import pytest

from omnisim import OmniCamera, load_scene, open_sensor
from omnisim.cameras import UnifiedCamera, pixel_grid
from omnisim.cameras.calibration import calibration_of
from omnisim.cameras.calibration.fit import fit_camera
from omnisim.core.errors import OmnisimError
from omnisim.core.poses import pose
from omnisim.ground_truth.hits import NO_DETAILS
from omnisim.perception.unwarping import Unwarping, cylinder_view
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl import parallax_camera
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.stage import Stage
from omnisim.rendering.twist import moved_px
from omnisim.scene.model import Material
from omnisim.validation.checks.optics import pose_beside_nearest, same_triangles
from omnisim.validation.image_differences import psnr_of_levels_db
from omnisim.validation.optical_systems import validation_systems
from omnisim.validation.plain_scenes import centroids, marker_pixels, markers_on_rays
from tests.cameras.optics.examples import SYSTEMS
from tests.rendering.frames import by_both, frame_of
from tests.scenes import room, room_color, room_hit, scene_of, with_warehouse
from tests.slow import slow_but
from tests.vehicles import box, p2at_body

NOW = pose((0.4, -0.3, 0.1), roll_deg=2.0, pitch_deg=-4.0, yaw_deg=30.0)
BEFORE = NOW @ pose((-0.1, 0.02, 0.0), yaw_deg=-3.0)
AFTER = NOW @ pose((0.12, 0.05, 0.02), roll_deg=1.0, pitch_deg=0.5, yaw_deg=4.0)


@pytest.fixture
def embree():
    """Skip without the ray caster."""
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")


def _small(name):
    return SYSTEMS[name].scaled(0.2)


def _world_rays(system, world_from_rig, pixels):
    """Origins and directions in the world of pixels, and their validity."""
    world_from_optical = world_from_rig[:3, :3] @ system.rig_from_optical
    rays = system.ray_from_pixel(pixels)
    origins = rays.origins_m @ world_from_optical.T + world_from_rig[:3, 3]
    return origins, rays.directions @ world_from_optical.T, rays.valid


@pytest.mark.parametrize("name", ["cone", "misaligned hyperbola", "folded"])
def test_image_and_channels(embree, name):
    system = _small(name)
    origins, directions, valid = _world_rays(system, NOW, pixel_grid(72, 72))
    expected = room_hit(origins, directions)
    sensor = OmniCamera(system, supersampling=1)
    channels = ("range", "z", "position", "normals", "instance")
    frame = frame_of(scene_of([room()]), sensor, NOW, "rays", linear=True, also=channels)
    np.testing.assert_array_equal(frame.has_ray, valid)
    assert valid.mean() > 0.2
    found = {key: value[valid] for key, value in frame.channels.items()}
    np.testing.assert_allclose(frame.linear[valid], room_color(expected[valid]), atol=1e-3)
    np.testing.assert_allclose(found["position"], expected[valid], atol=2e-6)
    lengths_m = np.linalg.norm(expected - origins, axis=-1)
    np.testing.assert_allclose(found["range"], lengths_m[valid], rtol=2e-6)
    axis = NOW[:3, :3] @ system.rig_from_optical[:, 2]
    np.testing.assert_allclose(found["z"], (expected[valid] - NOW[:3, 3]) @ axis, atol=2e-6)
    assert (found["instance"] == 1).all()
    facing = np.einsum("nj,nj->n", found["normals"], directions[valid])
    assert (facing < 0.0).all()


@pytest.mark.parametrize("name", ["sphere", "tilted port"])
def test_flow_leads_to_the_pixel_whose_ray_meets_the_point(embree, name):
    system = _small(name)
    meshes, poses = [room(), box("box", 0, half_m=0.4)], [np.eye(4), pose((1.0, 0.6, 0.1))]
    with open_sensor(scene_of(meshes, poses=poses), system, backend="rays") as renderer:
        frame = renderer.render(NOW, also=("flow", "position"), next_state=AFTER)
    points, status = frame.channels["position"], frame.channels["occluded"]
    flow = frame.channels["flow"].astype(np.float64)
    # a few rays leave a port so obliquely that they start behind the room's wall
    known = np.isfinite(flow[..., 0]) & (status < 2) & np.isfinite(points[..., 0])
    assert known.sum() > 500
    there = pixel_grid(72, 72)[known] + flow[known]
    origins, directions, valid = _world_rays(system, AFTER, there)
    assert valid.mean() > 0.99
    ways = points[known] - origins
    lengths_m = np.linalg.norm(ways, axis=-1)
    # flow is stored in float32, and a pixel is up to 0.1 rad
    misses = np.linalg.norm(np.cross(ways, directions), axis=-1) / lengths_m
    assert misses[valid].max() < 1e-5
    shown = _shows(renderer.scene, origins, directions, lengths_m)
    assert (shown == (status[known] == 0))[valid].mean() > 0.995
    assert (status == 1).sum() > 3


def _shows(scene, origins, directions, lengths_m):
    """Mask of the rays in whose way nothing is before a length."""
    from omnisim.rendering.rays.caster import RayCaster, WorldRays

    count = len(origins)
    rays = WorldRays(origins, directions, np.full(count, 0.05), np.full(count, np.inf))
    return RayCaster(scene).cast(rays).ranges_m >= (1.0 - 2e-3) * lengths_m


def test_motion_by_the_exact_inverse():
    """A step towards a port moves the image by as much as the inverse of its rays says."""
    still, moved = ([ScenePoses(NOW), ScenePoses(then)] for then in (NOW, AFTER))
    assert moved_px(_small("sphere"), still) == pytest.approx(0.0, abs=1e-6)
    assert moved_px(_small("sphere"), moved) > 1.0


STATES = {"next_state": AFTER, "previous_state": BEFORE}


def _near_boxes():
    """A room with boxes from 0.15 m on around the mirror of `_by_both`."""
    places = [(0.4, 0.05, 0.3, 20.0), (0.1, -0.5, 0.1, 50.0), (0.75, -0.2, 0.45, 5.0)]
    poses = [np.eye(4), *(pose(place[:3], yaw_deg=place[3]) for place in places)]
    colors = ((0.9, 0.9, 0.9), (0.8, 0.2, 0.1), (0.1, 0.3, 0.8), (0.2, 0.7, 0.2))
    meshes = [room(), *(box("box", k, half_m=0.08) for k in (1, 2, 3))]
    materials = [Material((*color, 1.0), double_sided=True) for color in colors]
    return scene_of(meshes, materials, poses)


def _psnr_db(one, other):
    seen = one.valid & other.valid
    return psnr_of_levels_db(one.rgb[seen], other.rgb[seen])


# As all cameras' images by both back ends; a cone squeezes more edges into fewer pixels.
@pytest.mark.parametrize(("name", "db"), [("tilted camera", 36.0), ("cone", 33.0), ("port", 36.0)])
def test_virtual_cameras_show_what_rays_do(embree, name, db):
    cube, rays = by_both(_near_boxes(), SYSTEMS[name].scaled(0.4), NOW)
    np.testing.assert_array_equal(cube.valid, rays.valid)
    assert _psnr_db(cube, rays) > db
    assert cube.metadata["undecided"]["cast"]
    assert 0 < cube.metadata["undecided"]["samples"] < 0.1 * 9 * cube.valid.sum()


def test_nothing_shines_through_beside_edges(embree):
    """Discs on black, seen by a cone: nothing of them is beside them."""
    system = validation_systems()["cone"]
    world_from_optical = NOW.copy()
    world_from_optical[:3, :3] = NOW[:3, :3] @ system.rig_from_optical
    pixels = marker_pixels(system, 40)
    scene = markers_on_rays(system, pixels, world_from_optical)
    middles = [
        centroids(frame.linear[..., 1].astype(np.float64), pixels)
        for frame in by_both(scene, system, NOW, linear=True)
    ]
    assert len(pixels) > 10
    assert np.linalg.norm(middles[0] - middles[1], axis=1).max() < 0.08


def test_no_seam_shows_in_the_sky():
    """Pixels at a ball's limb are many texels wide: their samples may be past a tile's gutter."""
    system, ground = SYSTEMS["sphere"].scaled(0.5), pose((0.0, 0.0, -101.0))
    scene = scene_of([box("ground", 0, half_m=100.0)], poses=[ground], background=(0.6, 0.7, 0.9))
    frame = frame_of(scene, system, NOW, linear=True)
    directions = _world_rays(system, NOW, pixel_grid(180, 180))[1]
    is_sky = frame.valid & (directions[..., 2] > 0.1)
    assert is_sky.mean() > 0.1
    np.testing.assert_allclose(frame.linear[is_sky], [scene.background] * is_sky.sum(), atol=1e-3)


CHANNELS = ("range", "z", "position", "normals", "normals_camera", "albedo", "instance", "semantic",
            "flow", "occluded", "flow_backward", "scene_flow", "valid")  # fmt: skip


TOLERANCES = {"albedo": 0.1, "flow": 0.01, "flow_backward": 0.01}  # filtered; a sensitive inverse


def _off(one, other, tolerance=2e-6):
    """Pixels whose values differ by more than float32 does, or a tolerance."""
    if one.dtype.kind in "iu":
        return one != other
    near = np.isclose(one, other, rtol=1e-5, atol=tolerance, equal_nan=True)
    return ~near.reshape(*near.shape[:2], -1).all(axis=-1)


@pytest.mark.parametrize("name", slow_but(["sphere", "cone", "port"], "sphere", long=["port"]))
def test_ground_truth_is_that_of_rays(embree, name):
    """A hand's breadth from boxes."""
    cube, rays = by_both(_near_boxes(), SYSTEMS[name].scaled(0.3), NOW, also=CHANNELS, **STATES)
    ray = rays.has_ray
    np.testing.assert_array_equal(cube.has_ray, ray)
    for channel in CHANNELS:
        values = cube.channels[channel], rays.channels[channel]
        assert _off(*values, TOLERANCES.get(channel, 2e-6))[ray].mean() <= 1e-3, channel


OWN_CAMERA = {"glass_tube", "mirror_cap", "mirror", "mast", "camera_body"}


@pytest.mark.parametrize("casts", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_the_robot_itself_is_right(embree, monkeypatch, casts):
    """A sphere of 100 mm, 8 cm from the scanner and a hand's breadth above the deck."""
    if not casts:
        monkeypatch.setattr(parallax_camera, "missing_packages", lambda extra: ["a"])
    sensor = OmniCamera(
        SYSTEMS["tilted camera"].scaled(0.5), base_from_rig=pose((-0.1, 0.0, 0.05)), near_m=0.02
    )
    base, frames = pose((0.3, -0.2, -1.2), roll_deg=1.0, pitch_deg=-2.0, yaw_deg=40.0), []
    for backend in ("cube", "rays"):
        with (
            Stage(scene_of([room()]), p2at_body(), backend=backend) as stage,
            stage.open(sensor, hidden=OWN_CAMERA) as renderer,
            renderer._current() as camera,
        ):
            frames.append(renderer.render(base, also=("range", "instance")))
            if backend == "cube":
                decided = ~camera.hit_source(NO_DETAILS).undecided
    cube, rays = frames
    ray, body = rays.has_ray, rays.channels["instance"] > 1
    assert body[ray].mean() > 0.3
    assert rays.channels["range"][body].min() < 0.08
    assert decided[ray].mean() > 0.8
    for channel in ("range", "instance"):
        off = _off(cube.channels[channel], rays.channels[channel])
        assert off[ray & decided].mean() <= 1e-3, channel
        assert off[ray].mean() <= (1e-3 if casts else 0.02), channel
    if casts:
        assert psnr_of_levels_db(*(frame.rgb[rays.valid] for frame in frames)) > 36.0


@pytest.mark.parametrize(
    "name", slow_but(["tilted camera", "cone"], "tilted camera", long=["cone"])
)
def test_ground_truth_without_rays(embree, monkeypatch, name):
    """No channel needs them; 99.4 % of the pixels are right."""
    taken = _near_boxes(), SYSTEMS[name].scaled(0.3), NOW
    expected = frame_of(*taken, "rays", also=CHANNELS[:-2], **STATES).channels
    monkeypatch.setattr(parallax_camera, "missing_packages", lambda extra: ["a"])
    monkeypatch.setitem(sys.modules, "embreex", None)
    frame = frame_of(*taken, also=CHANNELS[:-2], **STATES)
    for channel in ("range", "position", "normals", "instance"):
        off = _off(frame.channels[channel], expected[channel])
        assert off[frame.has_ray].mean() <= 6e-3, channel
    off = frame.channels["occluded"] != expected["occluded"]
    assert off[frame.has_ray].mean() <= 6e-3


@pytest.mark.slow
@with_warehouse("soccer", "mapping")
@pytest.mark.parametrize("name", ["sphere", "cone", "misaligned hyperbola"])
def test_same_triangles_as_exact_rays(embree, source, name):
    """At a scene's start, and 0.2 m beside furniture."""
    scene, sensor = load_scene(source), OmniCamera(SYSTEMS[name])
    start = sensor.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
    rays = RayScene(scene)
    with Stage(scene) as stage:
        for base in (start, pose_beside_nearest(sensor, rays, start)):
            shares = same_triangles(stage, rays, sensor, base)
            assert shares.cast >= 0.999
            assert shares.decided >= 0.999
            assert shares.alone >= 0.994
            assert shares.undecided <= 0.2


def test_ground_truth_follows_an_edit(embree):
    """A box goes, beside others that stay."""
    system, frames = SYSTEMS["sphere"].scaled(0.3), []
    scene = _near_boxes()
    edited = dataclasses.replace(scene, instances=(*scene.instances[:2], *scene.instances[3:]))
    for backend in ("cube", "rays"):
        with open_sensor(scene, system, backend=backend) as renderer:
            before = renderer.render(NOW, also=("range", "instance"))
            renderer.scene = edited
            frames.append(renderer.render(NOW, also=("range", "instance")))
    cube, rays = frames
    assert (before.channels["range"] != cube.channels["range"]).any()
    for channel in ("range", "instance"):
        off = _off(cube.channels[channel], rays.channels[channel])
        assert off[rays.has_ray].mean() <= 1e-3


def test_what_needs_one_viewpoint_says_so():
    system = _small("sphere")
    one = "expected a central camera, got model 'optics'"
    with pytest.raises(OmnisimError, match=f"unwarping: {one}"):
        Unwarping(system, cylinder_view(90, -math.radians(30.0), 0.0).camera, np.eye(3))
    with pytest.raises(OmnisimError, match=f"calibration: {one}"):
        calibration_of(system)
    with pytest.raises(OmnisimError, match=f"fit: {one}"):
        fit_camera(system, UnifiedCamera)
