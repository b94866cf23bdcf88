"""The robots' bodies: their sizes, their frames, and what they leave free for their sensors."""

import importlib
import tomllib
from collections import Counter

import numpy as np
import pytest
import trimesh

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots import load_robot
from omnisim.scene import load_scene
from omnisim.scene.model import AlphaMode
from tests.same_shapes import assert_same_shapes
from tests.scene.builder_hashes import SCENES, is_recorded
from tests.scene.world_corners import corners_of, material_of

ROBOTS = ("p2at", "superscout")
# Length, width, height of the body without the camera, of what is stated in the README.
BODY_M = {"p2at": (0.626, 0.505, 0.240), "superscout": (0.410, 0.410, 0.360)}
CAMERA = {"camera_body", "glass_tube", "mast", "mirror", "mirror_cap"}
ON_DECK = {"antenna", "control_panel", "emergency_stop", "lms200", "lms200_mount", "top_plate",
           "user_panel"}  # fmt: skip
MM = 1e-3


def robot_table(name):
    return tomllib.loads((SCENES / name / "robot.toml").read_text(encoding="utf-8"))


def sensors_of(name):
    return {sensor["name"]: sensor for sensor in robot_table(name)["sensors"]}


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request):
    """Name, and corners (triangles, 3, xyz) in the base frame of each node."""
    name = request.param
    scene = load_scene(SCENES / name / robot_table(name)["body"])
    assert scene.notices == ()
    assert len(scene.instance_names) == len(scene.instances)
    blended = [one for one in scene.instance_names
               if material_of(scene, one).alpha_mode is AlphaMode.BLEND]  # fmt: skip
    assert blended == ["glass_tube"]
    assert not any(material.double_sided for material in scene.materials)
    return name, {one: corners_of(scene, one) for one in scene.instance_names}


def bounds(corners):
    points = np.concatenate(list(corners)).reshape(-1, 3)
    return points.min(axis=0), points.max(axis=0)


def samples(triangles, steps=12):
    """Points (n, 3) all over triangles (m, 3, xyz)."""
    grid = np.array([(i, j, steps - i - j) for i in range(steps + 1) for j in range(steps + 1 - i)])
    return np.einsum("ki,mic->mkc", grid / steps, triangles).reshape(-1, 3)


def test_size_is_the_stated_one(robot):
    name, corners = robot
    low, high = bounds(corners.values())
    footprint = robot_table(name)["footprint"]
    size = footprint["length_m"], footprint["width_m"], footprint["height_m"]
    np.testing.assert_allclose(high - low, size, rtol=0, atol=MM)
    np.testing.assert_allclose(high[:2] + low[:2], 0.0, atol=MM)  # the origin is in the middle
    assert size[:2] == BODY_M[name][:2]
    deck = np.concatenate([corners[n] for n in corners if n not in CAMERA | ON_DECK])
    assert deck[..., 2].max() < BODY_M[name][2]
    # The plate itself, without its bolts and handles: where most of what faces up is.
    plate = corners["top_plate"]
    normals = np.cross(plate[:, 1] - plate[:, 0], plate[:, 2] - plate[:, 0])
    heights, index = np.unique(np.round(plate[..., 2].mean(axis=1), 4), return_inverse=True)
    facing_up = np.bincount(index, np.maximum(normals[:, 2], 0.0))
    assert heights[facing_up.argmax()] == pytest.approx(BODY_M[name][2], abs=MM)


def test_wheels_stand_on_the_ground(robot):
    name, corners = robot
    kinematics = robot_table(name)["kinematics"]
    wheels = {node: points for node, points in corners.items() if node.startswith("wheel_")}
    assert len(wheels) == (4 if kinematics["type"] == "skid_steer" else 2)
    middles = []
    for node, points in wheels.items():
        low, high = bounds([points])
        assert low[2] == pytest.approx(0.0, abs=MM)
        assert high[2] - low[2] == pytest.approx(kinematics["wheel_diameter_m"], abs=MM)
        middle = (low + high) / 2
        assert (middle[1] > 0) == ("left" in node)
        assert abs(middle[1]) == pytest.approx(kinematics["track_m"] / 2, abs=3 * MM)
        middles.append(middle)
    np.testing.assert_allclose(np.mean(middles, axis=0)[:2], 0.0, atol=MM)
    assert bounds(corners.values())[0][2] > -0.1 * MM


def test_view_of_the_mirror_is_free(robot):
    """Nothing between 70° and the rim, so the horizon and what is near it are free."""
    name, corners = robot
    sensor = OmniCamera.from_file(SCENES / name / "omnicam.toml")
    np.testing.assert_array_equal(sensor.base_from_rig, np.eye(4))  # robot.toml mounts it
    viewpoint = np.array(sensors_of(name)["omnicam"]["position_m"])
    ways = samples(np.concatenate(list(corners.values()))) - viewpoint
    distance = np.linalg.norm(ways, axis=1)
    seen = ways[distance > sensor.near_m]
    theta_deg = np.degrees(np.arctan2(np.hypot(seen[:, 0], seen[:, 1]), -seen[:, 2]))
    assert theta_deg.max() < 70.0
    # Nearer, the holder stays above the cone of the rim: physically, too, it hides nothing.
    rim = sensor.model.mirror.theta_max_rad
    cap = samples(corners["mirror_cap"]) - viewpoint
    assert np.all(np.arctan2(np.hypot(cap[:, 0], cap[:, 1]), -cap[:, 2]) > rim)


def test_mirror_and_lens_match_the_sensor_file(robot):
    name, corners = robot
    mirror = OmniCamera.from_file(SCENES / name / "omnicam.toml").model.mirror
    viewpoint = np.array(sensors_of(name)["omnicam"]["position_m"])
    shape = np.unique((corners["mirror"] - viewpoint).reshape(-1, 3), axis=0)
    below = shape[shape[:, 2] < -mirror.rim_height_m + 1e-5]
    assert below[:, 2].min() == pytest.approx(-mirror.vertex_height_m, abs=2e-5)
    radius = np.hypot(below[:, 0], below[:, 1])
    assert radius.max() == pytest.approx(mirror.rim_radius_m, abs=2e-5)
    # twice the vertices' rounding to 0.01 mm
    np.testing.assert_allclose(below[:, 2], -mirror.height_from_radius_m(radius), rtol=0, atol=2e-5)
    lens = (corners["camera_body"] - viewpoint).reshape(-1, 3)
    on_axis = lens[np.hypot(lens[:, 0], lens[:, 1]) < 1e-5]
    assert on_axis[:, 2].max() == pytest.approx(-mirror.c_m, abs=2e-5)


def test_solids_are_closed(robot):
    """Each edge is passed as often one way as the other: no hole shows an inside that is culled."""
    for node, triangles in robot[1].items():
        solid = trimesh.Trimesh(
            triangles.reshape(-1, 3), np.arange(triangles.size // 3).reshape(-1, 3)
        )
        solid.merge_vertices(digits_vertex=5)
        edges = Counter(map(tuple, solid.edges.tolist()))
        assert [edge for edge in edges if edges[edge] != edges[edge[::-1]]] == [], node
        assert solid.volume > 0, node


def test_robot_files_name_their_sensors():
    assert load_robot("p2at").sensor_names == ("omnicam", "lms200")
    assert load_robot("superscout").sensor_names == ("omnicam",)


def test_laser_scanner_is_around_its_scan_and_sees_past_the_robot():
    table = sensors_of("p2at")["lms200"]
    scan = np.array(table["position_m"])
    assert (scan[0], table["yaw_deg"]) == (0.160, 0.0)
    scene = load_scene(SCENES / "p2at" / "p2at.glb")
    for name in scene.instance_names:
        corners = corners_of(scene, name)
        if name == "lms200":
            low, high = bounds([corners])
            assert np.all((low < scan) & (scan < high))
            np.testing.assert_allclose(high - low, (0.155, 0.155, 0.210), rtol=0, atol=MM)
        else:  # nothing else is both ahead of the scan's origin and at its height
            heights = corners[corners[..., 0].max(axis=1) >= scan[0], :, 2]
            crosses = (heights.min(axis=1) <= scan[2]) & (scan[2] <= heights.max(axis=1))
            assert not crosses.any(), name


@pytest.mark.parametrize("name", ROBOTS)
def test_committed_file_is_what_a_changed_builder_builds(name, tmp_path, monkeypatch):
    if not is_recorded(name):
        test_committed_file_is_what_the_builder_builds(name, tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_committed_file_is_what_the_builder_builds(name, tmp_path, monkeypatch):
    pytest.importorskip("scenes", reason="the scripts are not installed")
    script = importlib.import_module(f"scenes.{name}.build")
    monkeypatch.setattr(script, "OUTPUT", tmp_path / script.OUTPUT.name)
    script.main()
    built, committed = load_scene(script.OUTPUT), load_scene(SCENES / name / f"{name}.glb")
    assert_same_shapes(built, committed)
