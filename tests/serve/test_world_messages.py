"""Floor map and description of a served robot, as others read them."""

from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.scene import Scene, read_scene
from omnisim.serve.served_world import map_message, robot_description


@pytest.fixture(scope="module")
def boxes():
    return BodyBoxes.of(Vehicle.load("p2at"))


def _at(grid, x_m, y_m):
    about, origin = grid.info, grid.info.origin.position
    column = int((x_m - origin.x) / about.resolution)
    row = int((y_m - origin.y) / about.resolution)
    return int(grid.data.reshape(about.height, about.width)[row, column])


def test_the_map_has_the_floor_and_what_stands_on_it(boxes):
    scene = read_scene("soccer")
    grid = map_message(scene, 0, "map", boxes)
    assert grid.data.dtype == np.int8
    assert _at(grid, 0.0, 0.0) == 0
    goal = next(each for each in scene.instances if each.name == "goal_yellow")
    corners = scene.meshes[goal.mesh].positions @ goal.world_from_mesh[:3, :3].T
    corners = corners + goal.world_from_mesh[:3, 3]
    back = corners[np.argmin(corners[:, 0])]
    assert _at(grid, float(back[0]) + 0.01, float(back[1])) == 100
    size_m = grid.info.width * grid.info.resolution, grid.info.height * grid.info.resolution
    assert size_m == pytest.approx((12.0, 9.0), abs=0.2)  # the room, not the hall around it


def test_a_scene_without_a_floor_has_no_map():
    wall = Scene.from_arrays("wall", [[2, -9, 0], [2, 9, 0], [2, 0, 3]], [[0, 1, 2]])
    assert map_message(wall, 0, "map", None) is None


def test_the_description_is_a_urdf_of_the_robots_boxes(boxes):
    mount = trimesh.transformations.euler_matrix(0.1, -0.2, 0.3)
    mount[:3, 3] = 0.1, 0.2, 0.3
    frames = {("base_link", "omnicam_optical_frame"): mount}
    text = robot_description("p2at", boxes, "base_link", frames)
    tree = ElementTree.fromstring(text)
    assert tree.tag == "robot"
    assert len(tree.findall("link/visual")) == len(boxes.parts_m)
    origin = tree.find("joint/origin")
    xyz, rpy = (list(map(float, origin.get(key).split())) for key in ("xyz", "rpy"))
    rebuilt = trimesh.transformations.euler_matrix(*rpy)  # static xyz, as URDF has it
    rebuilt[:3, 3] = xyz
    assert rebuilt == pytest.approx(mount, abs=1e-8)
