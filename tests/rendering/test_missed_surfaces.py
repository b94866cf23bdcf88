"""Small scenes and unusual viewpoints: what is seen of them, and what notes say is not."""

import dataclasses

import numpy as np
import pytest
import trimesh

from omnisim import OmniCamera, Scene, open_sensor
from omnisim.cameras import EquidistantCamera, EquirectangularCamera, PerspectiveCamera
from omnisim.core.poses import pose
from omnisim.rendering.missed_surfaces import near_plane_note, surfaces_too_near, viewpoint_notes
from omnisim.scene.parts import CameraPose
from omnisim.sensors.depth_camera.depth_camera import DepthCamera
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("radius_m", [0.01, 0.0005])
def test_a_small_object_is_seen_at_its_range(radius_m):
    ball = trimesh.creation.icosphere(4, radius_m)
    scene = Scene.from_arrays("ball", ball.vertices, ball.faces)
    with open_sensor(scene, EquirectangularCamera(128, 64)) as renderer:
        base = renderer.camera.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
        ranges_m = renderer.render(base, also=("range",)).channels["range"]
    distance_m = np.linalg.norm(scene.start.position_m)
    seen = ranges_m[np.isfinite(ranges_m)]
    # the cap of a sphere that is seen below its angular radius, on either side a pixel
    angle = np.arcsin(radius_m / distance_m)
    share = 0.5 * (1.0 - np.cos(angle))
    rows = np.pi * (np.arange(64) + 0.5) / 64
    weights = np.sin(rows)[:, None] * np.isfinite(ranges_m)
    assert weights.sum() / (128 * np.sin(rows).sum()) == pytest.approx(share, rel=0.05)
    assert seen.min() == pytest.approx(distance_m - radius_m, rel=0.005)  # of 5120 triangles
    assert seen.max() < np.sqrt(distance_m**2 - radius_m**2)


def test_a_near_plane_that_was_chosen_stays():
    assert OmniCamera(near_m=0.02).seeing(0.1).near_m == 0.02
    assert OmniCamera().seeing(0.1).near_m == pytest.approx(0.005)
    assert OmniCamera().seeing(10.0).near_m == 0.05


def _plate(name, x_m, half_m=1.0, **options):
    """Square plate across x, whose front faces the origin."""
    corners = [(x_m, -half_m, -half_m), (x_m, half_m, -half_m)]
    corners += [(x_m, half_m, half_m), (x_m, -half_m, half_m)]
    return Scene.from_arrays(name, corners, [(0, 2, 1), (0, 3, 2)], **options)


@pytest.mark.usefixtures("needs_opengl")
def test_depth_cameras_and_lidars_see_small_scenes():
    """A plate that the near planes of large scenes would cut away, and nothing behind it."""
    scene = _plate("plate", 0.008, 0.008)
    small = DepthCamera(
        width_px=32, height_px=24, focal_length_px=40.0, baseline_m=1e-4,
        range_min_m=0.002, range_max_m=0.1,
    ).without_noise()  # fmt: skip
    with open_sensor(scene, small) as renderer:
        depths_m = renderer.measure(np.eye(4)).depths_m
    np.testing.assert_allclose(depths_m[4:-4, 4:-4], 0.008, rtol=1e-3)
    lidar = SpinningLidar(firings=60, range_min_m=0.001, step_m=0.0, sigma_m=0.0)
    with open_sensor(scene, lidar) as renderer:
        points_m = renderer.scan(np.eye(4)).points["x"]
    # 16 rings, and each 6° up to 42° to either side: the plate ends at 45°
    assert len(points_m) == 16 * 15
    np.testing.assert_allclose(points_m, 0.008, rtol=1e-4)


LENS = OmniCamera(PerspectiveCamera(64, 48, 40.0, (31.5, 23.5)))


def test_what_the_near_plane_cuts_away_is_named():
    room = _plate("wall", 3.0).added("pole", _plate("pole", 0.03, 0.002))
    assert surfaces_too_near(room, LENS, np.eye(4)) == ("pole",)
    note = near_plane_note(room, LENS, np.eye(4))
    assert note is not None
    assert "near plane, 0.05 m: pole" in note
    # beside the image, behind the camera, or beyond the near plane
    assert near_plane_note(room, LENS, pose(yaw_deg=90.0)) is None
    assert near_plane_note(room, LENS, pose((0.04, 0.0, 0.0))) is None
    assert near_plane_note(room, LENS, pose((-0.03, 0.0, 0.0))) is None
    assert near_plane_note(room, OmniCamera(LENS.model, near_m=0.01), np.eye(4)) is None


@pytest.mark.parametrize(("yaw_deg", "x_m", "seen"), [(0.0, 0.0, True), (180.0, 0.06, False)])
def test_backs_that_are_not_drawn_are_not_missed(yaw_deg, x_m, seen):
    room = _plate("wall", 3.0).added("pole", _plate("pole", 0.03, 0.01, double_sided=False))
    there = pose((x_m, 0.0, 0.0), yaw_deg=yaw_deg)
    assert surfaces_too_near(room, LENS, there) == (("pole",) if seen else ())


ROOM_LENS = OmniCamera(PerspectiveCamera.with_field_of_view(64, 48, 1.0))


def _room(is_inward=True):
    """Room of 6 × 4 × 3 m, with a crate of 1 m in a corner."""
    room = trimesh.creation.box(extents=(6.0, 4.0, 3.0))
    if is_inward:
        room.invert()
    crate = trimesh.creation.box(extents=(1.0, 1.0, 1.0))
    scene = trimesh.Scene()
    scene.add_geometry(room, node_name="room", transform=pose((0, 0, 1.5)))
    scene.add_geometry(crate, node_name="crate", transform=pose((2.0, 1.0, 0.5)))
    return Scene.from_trimesh(scene, "room")


def _notes(scene, position, yaw_deg=0.0, sensor=ROOM_LENS):
    return viewpoint_notes(scene, sensor, sensor.base_pose(position, yaw_deg=yaw_deg))


@pytest.mark.parametrize("is_inward", [True, False])
def test_a_viewpoint_in_a_room_is_quiet(is_inward):
    """Also if the room's sides face outward, as those of a box do."""
    assert _notes(_room(is_inward), (0.0, 0.0, 1.0)) == []


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ((2.0, 1.0, 0.5), "the viewpoint (2, 1, 0.5) m is inside crate"),
        ((3.5, 0.0, 1.0), "is outside the scene, which spans -3 -2 0 to 3 2 3 m"),
        ((0.0, 0.0, -0.5), "is outside the scene"),
        ((0.0, -2.0, 1.0), "is 0 m from room, nearer than the near plane, 0.05 m"),
        ((-2.98, 0.0, 1.0), "is 0.02 m from room, nearer than the near plane"),
    ],
)
def test_an_unusual_viewpoint_is_said(position, words):
    (note,) = _notes(_room(), position)
    assert words in note


def test_viewpoints_of_the_scene_itself_are_not_outside():
    scene = _room()
    camera = CameraPose("shot", (0.0, -9.0, 1.0), 90.0)
    assert len(_notes(scene, camera.position_m, 90.0)) == 1
    assert _notes(dataclasses.replace(scene, cameras=(camera,)), camera.position_m, 90.0) == []
    assert _notes(scene, (0.0, 0.0, 9.0)) == []  # above, as from a drone


@pytest.mark.parametrize(("degrees", "count"), [(1.658, 1), (4.9, 1), (5.5, 0), (95.0, 0)])
def test_a_field_below_ten_degrees_is_said(degrees, count):
    """As that of `theta_max_deg` in radians."""
    lens = EquidistantCamera(65, 65, 32.0 / np.radians(degrees), (32.0, 32.0), np.radians(degrees))
    notes = _notes(_room(), (0.0, 0.0, 1.0), sensor=OmniCamera(lens))
    assert len(notes) == count
    if count:
        assert "angles named _deg are in degrees" in notes[0]
