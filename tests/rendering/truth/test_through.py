"""Channels behind panes and after mirrors, beside scenes without the pane and mirrored ones."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.core.errors import OmnisimError
from omnisim.core.extras import EXTRAS
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.labels import find_labels
from omnisim.scene.model import Material
from omnisim.sensors import DepthCamera
from omnisim.validation import reflective_rooms
from tests.cameras.optics.examples import SYSTEMS
from tests.rendering.frames import BACKENDS, each_backend, frame_of
from tests.rendering.rays.test_panes import reflected_by_pane
from tests.scenes import room, scene_of, upright

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
pytestmark = pytest.mark.usefixtures("needs_opengl")
ROOMS = reflective_rooms.rooms()
CAMERA = reflective_rooms.camera(48, 1)
AT = reflective_rooms.camera_pose()
ALSO = ("range", "range_through", "semantic", "semantic_through", "instance")


def channels(scene, backend, camera=CAMERA):
    return frame_of(scene, camera, AT, backend, also=ALSO).channels


def behind_a_panel(material):
    """A panel 1 m ahead of the origin, in a room."""
    panel = upright((1.9, 1.33), 1.0, material=1)
    return scene_of([room(), panel], [Material(double_sided=True), material])


@each_backend
def test_behind_a_pane_is_the_room_without_it(backend):
    scene = ROOMS["thin pane"]
    behind = channels(scene, backend)
    free = channels(scene.removed("panel"), "rays")
    np.testing.assert_allclose(behind["range_through"], free["range"], atol=1e-4)
    names = {kind.id: kind.name for kind in find_labels(scene).classes}
    free_names = {kind.id: kind.name for kind in find_labels(scene.removed("panel")).classes}
    assert [names[one] for one in behind["semantic_through"].ravel()] == [
        free_names[one] for one in free["semantic"].ravel()
    ]
    assert np.mean(behind["range"] < free["range"] - 0.1) > 0.1


@each_backend
def test_after_a_mirror_are_the_walls_along_mirrored_rays(backend):
    scene = ROOMS["planar mirror"]
    found = channels(scene, backend)
    panel = next(mesh for mesh in scene.meshes if mesh.name == "panel").positions.astype(np.float64)
    normal = np.cross(panel[1] - panel[0], panel[2] - panel[0])
    normal /= np.linalg.norm(normal)
    lens = CAMERA.model
    rays = lens.ray_from_pixel(pixel_grid(lens.width_px, lens.height_px)).directions
    rays = rays @ lens.rig_from_optical.T @ AT[:3, :3].T
    # the room is a box about the origin
    to_mirror_m = ((panel[0] - AT[:3, 3]) @ normal) / (rays @ normal)
    points = AT[:3, 3] + to_mirror_m[..., None] * rays
    mirrored = rays - 2.0 * (rays @ normal)[..., None] * normal
    to_walls_m = (np.sign(mirrored) * reflective_rooms.HALF_M - points) / mirrored
    expected_m = to_mirror_m + to_walls_m.min(axis=-1)
    names = [instance.name for instance in scene.instances]
    in_mirror = found["instance"] == 1 + names.index("panel")
    classes = {kind.name: kind.id for kind in find_labels(scene).classes}
    on_walls = in_mirror & (found["semantic_through"] == classes["walls"])
    assert 100 < on_walls.sum() < in_mirror.sum()  # the others show the post
    np.testing.assert_allclose(found["range_through"][on_walls], expected_m[on_walls], atol=1e-4)
    on_post = in_mirror & ~on_walls
    np.testing.assert_array_equal(found["semantic_through"][on_post], classes["post"])
    assert (found["range_through"][on_post] < expected_m[on_post]).all()
    for name in ("range", "semantic"):
        np.testing.assert_array_equal(found[f"{name}_through"][~in_mirror], found[name][~in_mirror])


def test_curved_mirrors_bend_rays_by_their_normals():
    """Both back ends alike; the default one misses triangles narrower than a texel at the rim."""
    scene = ROOMS["chrome ball"]
    found, drawn = channels(scene, "rays"), channels(scene, "cube")
    both = found["instance"] == drawn["instance"]
    assert both.mean() > 0.98
    np.testing.assert_allclose(
        drawn["range_through"][both], found["range_through"][both], rtol=1e-3
    )
    assert (found["range_through"] - found["range"]).max() > 2.0


@pytest.mark.parametrize("name", ["tilted camera", "hyperbola"])
def test_optical_systems_follow_each_ray_from_its_origin(name):
    sensor = OmniCamera(SYSTEMS[name].scaled(0.15), supersampling=1)
    cast, drawn = (channels(ROOMS["planar mirror"], backend, sensor) for backend in BACKENDS[::-1])
    np.testing.assert_allclose(drawn["range_through"], cast["range_through"], atol=1e-3)
    seen = np.isfinite(cast["range"])
    assert np.mean(cast["range_through"][seen] > cast["range"][seen] + 0.1) > 0.01


@each_backend
def test_blurred_and_matte_floors_end_rays(backend):
    for name in ("floor of roughness 0.1", "floor of roughness 0.3"):
        found = channels(ROOMS[name], backend)
        np.testing.assert_array_equal(found["range_through"], found["range"])
        np.testing.assert_array_equal(found["semantic_through"], found["semantic"])


def test_without_embreex_the_default_back_end_says_what_it_needs(monkeypatch):
    monkeypatch.setitem(EXTRAS, "rays", {"embreex": "no_such_module"})
    with pytest.raises(OmnisimError, match=r"behind glass and in mirrors needs embreex: pip"):
        channels(ROOMS["thin pane"], "cube")
    plain = channels(scene_of([room()], [Material(double_sided=True)]), "cube")
    np.testing.assert_array_equal(plain["range_through"], plain["range"])


DEPTHS = dataclasses.replace(
    DepthCamera(width_px=48, height_px=36, focal_length_px=40.0).without_noise(), range_max_m=20.0
)


def depths(scene, backend="rays", camera=DEPTHS, at=AT):
    with open_sensor(scene, camera, backend=backend) as renderer:
        return renderer.measure(at).depths_m


@each_backend
def test_a_depth_camera_sees_through_panes(backend):
    scene = ROOMS["thin pane"]
    behind, free = depths(scene, backend), depths(scene.removed("panel"))
    measured = (behind > 0.0) & (free > 0.0)
    assert measured.mean() > 0.8
    np.testing.assert_allclose(behind[measured], free[measured], atol=1e-3)
    assert (behind == 0.0).mean() < (free == 0.0).mean() + 0.05
    stops = depths(scene, backend, dataclasses.replace(DEPTHS, specular=False))
    assert np.mean(behind - stops > 0.1) > 0.1


@each_backend
def test_a_depth_camera_measures_the_mirrored_distance(backend):
    """In a mirror across the room, the wall behind the camera is as far behind the mirror."""
    scene = behind_a_panel(Material(metallic=1.0, roughness=0.0, double_sided=True))
    found = depths(scene, backend, at=np.eye(4))
    assert found[18, 24] == pytest.approx(1.0 + 1.0 + 3.0, abs=1e-3)


def test_too_little_light_behind_panes_is_a_hole():
    def through(transmission):
        glass = {"roughness": 0.0, "specular": 1.0, "transmission": transmission}
        return depths(behind_a_panel(Material(double_sided=True, **glass)), at=np.eye(4))

    once = 1.0 - reflected_by_pane(0.0, 1.5)
    limit = np.sqrt(0.1) / once  # light of the projector passes twice
    assert through(limit * 1.01)[18, 24] == pytest.approx(3.0, abs=1e-3)
    assert through(limit * 0.99)[18, 24] == 0.0
