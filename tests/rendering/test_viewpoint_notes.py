"""Notes on unusual viewpoints: one line each, and none for usual ones."""

import dataclasses

import numpy as np
import pytest
import trimesh

from omnisim import OmniCamera, Scene
from omnisim.cameras import EquidistantCamera, PerspectiveCamera
from omnisim.core.poses import pose
from omnisim.rendering.missed_surfaces import viewpoint_notes
from omnisim.scene.parts import CameraPose
from omnisim.scene.space.start_pose import StartPose

LENS = OmniCamera(PerspectiveCamera.with_field_of_view(64, 48, 1.0))


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


def _notes(scene, position, yaw_deg=0.0, sensor=LENS):
    return viewpoint_notes(scene, sensor, sensor.base_pose(position, yaw_deg=yaw_deg))


@pytest.mark.parametrize("is_inward", [True, False])
def test_a_viewpoint_in_a_room_is_quiet(is_inward):
    """Also if the room's sides face outward, as those of a box do."""
    assert _notes(_room(is_inward), (0.0, 0.0, 1.0)) == []


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ((2.0, 1.0, 0.5), "the viewpoint (2, 1, 0.5) m is inside of crate"),
        (
            (3.5, 0.0, 1.0),
            "is outside of the scene, which is from -3 -2 0 to 3 2 3 m",
        ),
        ((0.0, 0.0, -0.5), "is outside of the scene"),
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


def test_a_start_outside_is_said_unless_the_scene_is_too_small_to_stand_in():
    scene = dataclasses.replace(_room(), start=StartPose((9.0, 0.0, 1.0)))
    assert "is outside of the scene" in _notes(scene, scene.start.position_m)[0]
    small = Scene.from_trimesh(trimesh.creation.box(extents=(0.2, 0.2, 0.2)), "small")
    assert _notes(small, small.start.position_m, small.start.yaw_deg) == []


@pytest.mark.parametrize(("degrees", "count"), [(1.658, 1), (4.9, 1), (5.5, 0), (95.0, 0)])
def test_a_field_below_ten_degrees_is_said(degrees, count):
    """As that of `theta_max_deg` in radians."""
    lens = EquidistantCamera(65, 65, 32.0 / np.radians(degrees), (32.0, 32.0), np.radians(degrees))
    notes = _notes(_room(), (0.0, 0.0, 1.0), sensor=OmniCamera(lens))
    assert len(notes) == count
    if count:
        assert "angles named _deg are in degrees" in notes[0]
