"""Channels behind panes and after mirrors, beside scenes without the pane and mirrored ones."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.errors import OmnisimError
from omnisim.core.extras import EXTRAS
from omnisim.rendering.stage import open_sensor
from omnisim.scene.labels import find_labels
from omnisim.scene.model import Material
from omnisim.sensors import DepthCamera
from omnisim.validation.checks import reflective_rooms
from tests.rendering.rays.test_panes import reflected_by_pane
from tests.scenes import room, scene_of, square

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
pytestmark = pytest.mark.usefixtures("needs_opengl")
BACKENDS = ["cube", "rays"]
ROOMS = reflective_rooms.rooms()
CAMERA = reflective_rooms.camera(48, 1)
AT = reflective_rooms.camera_pose()
ALSO = ("range", "range_through", "semantic", "semantic_through", "instance")


def channels(scene, backend, camera=CAMERA):
    with open_sensor(scene, camera, backend=backend) as renderer:
        return renderer.render(AT, also=ALSO).channels


@pytest.mark.parametrize("backend", BACKENDS)
def test_behind_a_pane_is_the_room_without_it(backend):
    scene = ROOMS["thin pane"]
    behind = channels(scene, backend)
    free = channels(scene.removed("panel"), "rays")
    np.testing.assert_allclose(behind["range_through"], free["range"], atol=1e-4)
    names = {one.id: one.name for one in find_labels(scene).classes}
    free_names = {one.id: one.name for one in find_labels(scene.removed("panel")).classes}
    assert [names[one] for one in behind["semantic_through"].ravel()] == [
        free_names[one] for one in free["semantic"].ravel()
    ]
    assert np.mean(behind["range"] < free["range"] - 0.1) > 0.1


@pytest.mark.parametrize("backend", BACKENDS)
def test_after_a_mirror_is_the_mirrored_room(backend):
    scene = ROOMS["planar mirror"]
    found = channels(scene, backend)
    panel = next(one for one in scene.meshes if one.name == "panel").positions.astype(np.float64)
    normal = np.cross(panel[1] - panel[0], panel[2] - panel[0])
    normal /= np.linalg.norm(normal)
    mirror = np.eye(4)
    mirror[:3, :3] -= 2.0 * np.outer(normal, normal)
    mirror[:3, 3] = 2.0 * (panel[0] @ normal) * normal
    behind = scene.removed("panel")
    meshes = tuple(
        dataclasses.replace(
            one,
            positions=(one.positions @ mirror[:3, :3].T + mirror[:3, 3]).astype(np.float32),
        )
        for one in behind.meshes
    )
    mirrored = channels(dataclasses.replace(behind, meshes=meshes), "rays")
    names = [one.name for one in scene.instances]
    in_mirror = found["instance"] == 1 + names.index("panel")
    assert in_mirror.sum() > 100
    # the mirrored walls cross the room: where they are nearer than the mirror, they hide what it
    # shows
    clear = in_mirror & (mirrored["range"] > found["range"])
    assert clear.sum() > 100
    np.testing.assert_allclose(found["range_through"][clear], mirrored["range"][clear], atol=1e-4)
    np.testing.assert_array_equal(found["range_through"][~in_mirror], found["range"][~in_mirror])
    np.testing.assert_array_equal(
        found["semantic_through"][~in_mirror], found["semantic"][~in_mirror]
    )


def test_curved_mirrors_show_what_the_image_shows():
    """The normals of the ball's vertices bend the rays, as in the image."""
    scene = ROOMS["chrome ball"]
    found = channels(scene, "rays")
    cube = channels(scene, "cube")
    np.testing.assert_allclose(found["range_through"], cube["range_through"], rtol=1e-3)
    shown = found["range_through"] - found["range"]
    assert shown.max() > 2.0
    assert np.isfinite(found["range_through"]).all()


@pytest.mark.parametrize("backend", BACKENDS)
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
        return renderer.measure(at)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_depth_camera_sees_through_panes(backend):
    scene = ROOMS["thin pane"]
    behind, free = depths(scene, backend), depths(scene.removed("panel"))
    measured = (behind > 0.0) & (free > 0.0)
    assert measured.mean() > 0.8
    np.testing.assert_allclose(behind[measured], free[measured], atol=1e-3)
    assert (behind == 0.0).mean() < (free == 0.0).mean() + 0.05
    stops = depths(scene, backend, dataclasses.replace(DEPTHS, specular=False))
    assert np.mean(behind - stops > 0.1) > 0.1


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_depth_camera_measures_the_mirrored_distance(backend):
    """In a mirror across the room, the wall behind the camera is as far behind the mirror."""
    mirror = square(half_m=1.9, material=1, name="mirror")
    positions = mirror.positions[:, [2, 0, 1]] * (1.0, 1.0, 0.7) + (1.0, 0.0, 0.0)
    mirror = dataclasses.replace(mirror, positions=positions.astype(np.float32))
    metal = Material(metallic=1.0, roughness=0.0, double_sided=True)
    scene = scene_of([room(), mirror], [Material(double_sided=True), metal])
    found = depths(scene, backend, at=np.eye(4))
    assert found[18, 24] == pytest.approx(1.0 + 1.0 + 3.0, abs=1e-3)


def test_too_little_light_behind_panes_is_a_hole():
    def through(transmission):
        pane = square(half_m=1.9, material=1)
        positions = pane.positions[:, [2, 0, 1]] * (1.0, 1.0, 0.7) + (1.0, 0.0, 0.0)
        pane = dataclasses.replace(pane, positions=positions.astype(np.float32))
        glass = Material(
            base_color=(1.0, 1.0, 1.0, 1.0), roughness=0.0, specular=1.0,
            transmission=transmission, double_sided=True,
        )  # fmt: skip
        return depths(scene_of([room(), pane], [Material(double_sided=True), glass]), at=np.eye(4))

    once = 1.0 - reflected_by_pane(0.0, 1.5)
    limit = np.sqrt(0.1) / once  # light of the projector passes twice
    assert through(limit * 1.01)[18, 24] == pytest.approx(3.0, abs=1e-3)
    assert through(limit * 0.99)[18, 24] == 0.0
