"""The soccer scene against the field's own measures, in meters, to one millimeter."""

import numpy as np
import pytest

from omnisim.scene import load_scene
from tests.scene.world_corners import corners_of, material_of

MM = 1e-3
# Of each line: smallest and largest corner (x0, y0, x1, y1). Field 5.4 x 3.6, goal boxes
# 1.3 x 0.65, all to the outer edges of lines 0.025 wide.
LINES = {
    "line_touch_left": (-2.7, 1.775, 2.7, 1.8),
    "line_touch_right": (-2.7, -1.8, 2.7, -1.775),
    "line_goal_yellow": (-2.7, -1.775, -2.675, 1.775),
    "line_goal_blue": (2.675, -1.775, 2.7, 1.775),
    "line_halfway": (-0.0125, -1.775, 0.0125, 1.775),
    "line_box_yellow": (-2.675, -0.65, -2.05, 0.65),
    "line_box_blue": (2.05, -0.65, 2.675, 0.65),
}
LINE_AREA = (
    2 * 5.4 * 0.025  # touch lines
    + 3 * 3.55 * 0.025  # goal lines and halfway line
    + 2 * (1.3 * 0.625 - 1.25 * 0.6)  # boxes
    + np.pi * (0.18**2 - 0.155**2)  # circle, whose crossing by the halfway line is
    - 2 * 0.025**2  # counted twice: two squares but for their curved ends
)
# Beacons by their side, seen from the yellow goal towards the blue one:
# x, y, and the bands that end at 0.2, 0.3 and 0.4.
BEACONS = {
    "beacon_left_yellow": (-1.35, 1.95, ("white", "pink", "yellow")),
    "beacon_right_yellow": (-1.35, -1.95, ("white", "yellow", "pink")),
    "beacon_left_blue": (1.35, 1.95, ("white", "pink", "sky_blue")),
    "beacon_right_blue": (1.35, -1.95, ("white", "sky_blue", "pink")),
}


@pytest.fixture(scope="module")
def scene():
    return load_scene("soccer")


def _names(scene, name):
    return [one for one in scene.instance_names if one == name or one.startswith(f"{name}_")]


def _corners(scene, name):
    """World corners (n, 3, 3) of the triangles of all nodes of a name or below it."""
    return np.concatenate([corners_of(scene, one) for one in _names(scene, name)])


def _box(scene, name):
    corners = _corners(scene, name)
    return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))


def _area_from_above(corners):
    on_top = np.abs(corners[..., 2]).max(axis=1) < 1e-5
    a, b, c = np.moveaxis(corners[on_top][..., :2], 1, 0)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    doubled = ux * vy - uy * vx
    assert (doubled > 0.0).all(), "a piece faces the floor"
    return 0.5 * doubled.sum()


def test_lines_are_where_the_rules_put_them(scene):
    for name, (x0, y0, x1, y1) in LINES.items():
        expected = ((x0, y0, 0.0), (x1, y1, 0.0))
        np.testing.assert_allclose(_box(scene, name), expected, rtol=0, atol=MM, err_msg=name)
        assert np.abs(_corners(scene, name)[..., 2]).max() < 1e-5
    circle = _corners(scene, "line_centre_circle")
    radius = np.hypot(circle[..., 0], circle[..., 1])
    assert (radius.max(), radius.min()) == pytest.approx((0.180, 0.155), abs=MM)


def test_carpet_and_lines_cover_the_plane_once(scene):
    low, high = _box(scene, "carpet")
    np.testing.assert_allclose([*low[:2], *high[:2]], (-3.0, -2.0, 3.0, 2.0), atol=1e-5)
    lines = _area_from_above(_corners(scene, "line"))
    assert lines == pytest.approx(LINE_AREA, abs=2e-4)
    assert lines + _area_from_above(_corners(scene, "carpet")) == pytest.approx(24.0, abs=1e-5)


def test_goals_stand_on_their_lines(scene):
    for name, near, far in (("goal_yellow", -3.0, -2.7), ("goal_blue", 2.7, 3.0)):
        expected = ((near, -0.4, 0.0), (far, 0.4, 0.3))
        np.testing.assert_allclose(_box(scene, name), expected, rtol=0, atol=MM)


def test_beacons_have_their_places_and_bands(scene):
    for name, (x, y, colors) in BEACONS.items():
        for color, foot, top in zip(colors, (0.0, 0.2, 0.3), (0.2, 0.3, 0.4), strict=True):
            expected = ((x - 0.05, y - 0.05, foot), (x + 0.05, y + 0.05, top))
            found = _box(scene, f"{name}_{color}")
            np.testing.assert_allclose(found, expected, rtol=0, atol=MM)


def test_listed_landmarks_are_the_geometry(scene):
    colors = {one.name: tuple(band.color for band in one.bands) for one in scene.landmarks}
    goals = {"goal_yellow": ("yellow",), "goal_blue": ("sky_blue",)}
    assert colors == goals | {name: bands for name, (_, _, bands) in BEACONS.items()}
    for landmark in scene.landmarks:
        low, high = _box(scene, landmark.name)
        middle = (low + high) / 2
        np.testing.assert_allclose(landmark.position_m, (*middle[:2], low[2]), atol=MM)
        np.testing.assert_allclose(landmark.footprint_m, (high - low)[:2], atol=MM)
        assert landmark.height_m == pytest.approx(high[2] - low[2], abs=MM)
        for band in landmark.bands:
            is_whole = len(landmark.bands) == 1
            name = landmark.name if is_whole else f"{landmark.name}_{band.color}"
            low, high = _box(scene, name)
            assert (low[2], high[2]) == pytest.approx((band.bottom_m, band.top_m), abs=MM)
            material = material_of(scene, name)
            assert material.texture is None
            # the file holds whole 255ths
            np.testing.assert_allclose(material.base_color[:3], band.linear_rgb, atol=0.51 / 255)


def test_nothing_else_stands_near_the_field(scene):
    own = ("carpet", "line_", "goal_", "beacon_", "floor", "ceiling", "beam_", "lamp_", "outside_")
    for name in (one for one in scene.instance_names if not one.startswith((*own, "wall_"))):
        low, high = _box(scene, name)
        inside = (low[:2] < (3.1, 2.2)) & (high[:2] > (-3.1, -2.2))
        assert low[2] >= 2.5 or not inside.all(), name


def test_vehicles_start_on_the_field_and_clear_of_landmarks(scene):
    assert {"lap_clockwise", "lap_counter_clockwise"} <= {start.name for start in scene.starts}
    reach = np.hypot(0.63, 0.50) / 2
    for start in scene.starts:
        assert start.position_m[2] == 0.0
        position = np.array(start.position_m[:2])
        assert (np.abs(position) <= (2.7, 1.8)).all()
        for landmark in scene.landmarks:
            half = np.array(landmark.footprint_m) / 2
            beside = np.abs(position - landmark.position_m[:2]) - half
            assert np.hypot(*np.maximum(beside, 0.0)) > reach, (start.name, landmark.name)
