"""Reflectors within reflections, mirrors beyond the number of mirrored views, and their choice."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.scene.model import Lighting, Material
from omnisim.scene.planar_mirrors import scene_surfaces
from omnisim.scene.reflection_probes import find_reflectors
from omnisim.validation import reflective_rooms
from tests.rendering import furnished
from tests.scenes import room, room_color, room_hit, scene_of, square
from tests.vehicles import box

pytestmark = pytest.mark.usefixtures("needs_opengl")

SHINING = Material("walls", unlit=True, double_sided=True)
MIRROR = Material("mirror", metallic=1.0, roughness=0.0, double_sided=True)
DARK = Lighting((0.0, 0.0, 0.0), ())
AT = pose((-0.5, 0.2, 0.1), yaw_deg=3.0)
WIDTH_PX = 64


def _upright(x_m, y_m=0.0, half_m=1.0):
    """Pose of a square that stands across x."""
    turned = pose((x_m, y_m, 0.0), pitch_deg=90.0)
    turned[:3, :3] *= half_m
    return turned


def _facing(half_m=1.2):
    """A room with a mirror at each end."""
    meshes = [room(), *[square(1.0, material=1, name=name) for name in ("front", "back")]]
    places = [np.eye(4), _upright(2.9, half_m=half_m), _upright(-2.9, half_m=half_m)]
    return scene_of(meshes, [SHINING, MIRROR], places, DARK)


def _row(count=6):
    """Equal mirrors beside each other, across the camera's axis."""
    meshes = [
        room(),
        *[square(1.0, material=1, name=f"mirror {number}") for number in range(count)],
    ]
    offsets = 0.5 * (np.arange(count) - 0.5 * (count - 1))
    depths = 2.0 + 0.001 * np.arange(count)  # not coplanar
    places = [_upright(x, y, 0.2) for x, y in zip(depths, offsets, strict=True)]
    return scene_of(meshes, [SHINING, MIRROR], [np.eye(4), *places], DARK)


def _seen(scene, at, sensor=None, **settings):
    sensor = sensor or reflective_rooms.camera(WIDTH_PX, 1)
    with open_sensor(scene, dataclasses.replace(sensor, **settings)) as renderer:
        return renderer.render(at, linear=True).linear[..., :3]


def _rays():
    model = reflective_rooms.camera(WIDTH_PX, 1).model
    v, u = np.indices((model.height_px, model.width_px)).reshape(2, -1)
    rays = model.ray_from_pixel(np.column_stack((u, v)).astype(np.float64)).directions
    forward, left, up = AT[:3, :3].T
    return rays @ np.stack((-left, -up, forward))


def _through(starts_m, directions, x_m):
    """Points where rays meet the plane of a mirror, and the mask of those that are well within."""
    with np.errstate(divide="ignore", invalid="ignore"):
        points_m = starts_m + ((x_m - starts_m[:, :1]) / directions[:, :1]) * directions
    return points_m, np.all(np.abs(points_m[:, 1:]) < 1.05, axis=1)


def test_a_mirror_in_a_mirror_reflects_each_wall_where_it_is():
    """By the closed form of rays that are mirrored twice; it was black."""
    directions = _rays()
    first_m, is_first = _through(np.tile(AT[:3, 3], (len(directions), 1)), directions, 2.9)
    back = directions * (-1.0, 1.0, 1.0)
    second_m, is_second = _through(first_m, back, -2.9)
    _, is_third = _through(second_m, directions, 2.9)
    outside = np.abs(second_m + 5.8 / directions[:, :1] * directions)[:, 1:].max(axis=1) > 1.35
    own = is_first & is_second & ~is_third & outside & (directions[:, 0] > 0.0)
    assert np.count_nonzero(own) > 20
    expected = room_color(room_hit(second_m[own], directions[own]))
    seen = _seen(_facing(), AT).reshape(-1, 3)[own]
    assert np.median(np.abs(seen - expected)) < 0.03
    assert np.quantile(np.abs(seen - expected), 0.9) < 0.15


@pytest.mark.parametrize("mirrors", [0, 1])
def test_mirrors_beyond_those_with_views_show_a_probe(mirrors):
    """Near the mirrored view of the room; it was black, as nothing lights the room."""
    exact = _seen(_row(3), AT, mirrors=8)
    few = _seen(_row(3), AT, mirrors=mirrors)
    off = np.abs(exact - few).max(axis=-1)
    assert np.count_nonzero(off > 0.0) > 20
    assert np.quantile(off, 0.99) < 0.1
    without = _seen(_row(3), AT, mirrors=mirrors, reflection_probes=0)
    assert np.count_nonzero(np.abs(exact - without).max(axis=-1) > 0.2) > 20


def test_mirrored_views_are_those_in_the_middle_of_equal_ones():
    at = pose((-2.0, 0.0, 0.0))
    exact, few = (_seen(_row(), at, mirrors=mirrors) for mirrors in (8, 2))
    columns = np.flatnonzero((np.abs(exact - few).max(axis=-1) > 0.0).any(axis=0))
    middle = 0.5 * (WIDTH_PX - 1)
    assert np.abs(columns - middle).min() >= 4  # both halves of the middle pair are exact
    assert columns.min() < middle < columns.max()


def test_the_mirrored_view_is_that_of_the_mirror_that_fills_most_of_the_image():
    """A small, near one, and not the large, far one to the right of it."""
    meshes = [room(), square(1.0, material=1, name="near"), square(1.0, material=1, name="far")]
    places = [np.eye(4), _upright(0.4, 0.25, 0.3), _upright(2.9, half_m=1.2)]
    scene = scene_of(meshes, [SHINING, MIRROR], places, DARK)
    exact, few = (_seen(scene, pose(), mirrors=mirrors) for mirrors in (8, 1))
    off = np.abs(exact - few).max(axis=-1) > 0.0
    assert off.any()
    assert not off[:, : WIDTH_PX // 4].any()


def test_floors_have_a_probe_where_they_are():
    """The center of an L-shaped floor's bounds is outside of the room."""
    found = find_reflectors(scene_surfaces(furnished.furnished_room(), []))
    floor = furnished.names().index("floor")
    (place,) = (one for one in found.planar_places if floor in one.surfaces)
    x, y, z = place.center_m
    assert z == 0.0
    assert any(low[0] <= x <= high[0] and low[1] <= y <= high[1] for low, high in furnished.LEVELS)
    names = {furnished.names()[index] for one in found.planar_places for index in one.surfaces}
    assert names == {*furnished.UPRIGHTS, *furnished.PANES, "floor"}


@pytest.mark.parametrize("moves", [False, True])
def test_images_do_not_depend_on_the_order_of_poses(moves):
    """A batch, which is drawn forward, has the images that are drawn in another order."""
    objects = {"cube": scene_of([box("cube", 0)], [Material(base_color=(0.9, 0.1, 0.1, 1.0))])}
    sensor = furnished.camera(48, 1)
    with Stage(furnished.furnished_room(), dynamic_objects=objects if moves else {}) as stage:
        with stage.open(sensor) as renderer:
            states = [
                WorldState(
                    {renderer.vehicle: at}
                    | ({"cube": pose((-2.0, -1.0 - 0.2 * number, 1.5))} if moves else {})
                )
                for number, at in enumerate(furnished.VIEWS.values())
            ]
            images = {number: renderer.render(states[number]).rgb for number in (2, 0, 3, 1)}
        with stage.open(sensor) as renderer:
            batch = renderer.render_batch(states)
    assert len(batch) == len(images)
    for number, image in images.items():
        np.testing.assert_array_equal(batch[number], image)
