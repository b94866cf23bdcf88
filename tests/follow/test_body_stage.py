"""Bodies of another simulator: names, poses in its arrays, shapes of files and without a file."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import NoticeWarning, OmnisimError, SceneError
from omnisim.follow import BodyStage, Shape, shape_scene
from omnisim.follow.body_shapes import height_field
from omnisim.follow.body_stage import match_names
from omnisim.scene import primitives
from omnisim.sensors import SpinningLidar

LENS = EquidistantCamera(65, 65, 20.0, (32.0, 32.0), 1.6)
ARM = """
<robot name="arm">
  <link name="base"><visual><geometry><box size="0.4 0.4 0.2"/></geometry></visual></link>
  <link name="upper"><visual><geometry><box size="0.2 0.2 1"/></geometry></visual></link>
  <link name="hand"><visual><geometry><sphere radius="0.2"/></geometry></visual></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.6" rpy="0.3 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1"/>
  </joint>
  <joint name="wrist" type="fixed">
    <parent link="upper"/><child link="hand"/><origin xyz="0 0 0.6"/>
  </joint>
</robot>
"""
STILL = shape_scene("", [Shape(primitives.rectangle(5.0, 5.0), name="floor")])
BALL = shape_scene("ball", [Shape(primitives.ellipsoid((0.5, 0.5, 0.5)), color=(1.0, 0.0, 0.0))])
POSITIONS = np.array([[0.0, 0.0, 0.1], [0.5, 0.0, 0.7]])
TURNS = Rotation.from_euler("xyz", [[0.0, 0.0, 0.0], [0.3, 0.1, 1.0]])


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return path


@pytest.fixture(scope="module")
def ball_stage():
    with BodyStage(STILL, {"ball": BALL}, names=["mast", "ball"]) as stage:
        yield stage


def wxyz(turns):
    return turns.as_quat()[..., [3, 0, 1, 2]]


def range_ahead(camera, state):
    """Range of the middle pixel."""
    return float(camera.render(state, also=("range",)).channels["range"][32, 32])


def test_links_move_as_one_body_with_what_is_fixed_to_them(arm):
    names = ["go/base_x", "arm/base", "arm/upper"]
    with BodyStage(STILL, {"arm": arm}, names=names, quaternions="xyzw") as stage:
        positions = np.vstack(([9.0, 9.0, 9.0], POSITIONS))
        quaternions = np.vstack(([0.0, 0.0, 0.0, 1.0], TURNS.as_quat()))
        hand_m = POSITIONS[1] + TURNS[1].apply((0.0, 0.0, 0.6))
        camera = stage.open(LENS, omnisim.pose(hand_m + (-2.0, 0.0, 0.0)))
        state = stage.state(positions, quaternions, 1.5)
        frame = camera.render(state, also=("instance",))
        assert state.time_s == 1.5
        assert stage.body_ids(frame)[32, 32] == 2
        assert range_ahead(camera, state) == pytest.approx(1.8, abs=1e-3)
    assert stage.notices == ("invisible: 1 body in no file: go/base_x",)


def test_masks_tell_links_that_are_fixed_to_each_other_apart(arm):
    names = ["base", "upper", "hand"]
    with BodyStage(STILL, {"arm": arm}, names=names, quaternions="xyzw") as stage:
        assert sorted(stage.objects) == ["base", "upper"]
        camera = stage.open(LENS, omnisim.pose((-2.0, 0.0, 1.2)))
        turns = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))
        state = stage.state([[0.0, 0.0, 0.1], [0.0, 0.0, 0.6], [0.0, 0.0, 1.2]], turns)
        ids = stage.body_ids(camera.render(state, also=("instance",)))
    assert ids[32, 32] == 2
    assert set(np.unique(ids)) == {-1, 0, 1, 2}


def test_a_sensor_rides_on_a_body_and_takes_part_of_its_name(ball_stage):
    turn = Rotation.from_euler("z", [[90.0], [0.0]], degrees=True)
    state = ball_stage.state([[0.0, -3.0, 1.0], [0.0, 0.0, 1.0]], wxyz(turn))
    assert range_ahead(ball_stage.open(LENS, vehicle="mast"), state) == pytest.approx(2.5, abs=1e-3)
    cloud = ball_stage.open(SpinningLidar.vlp16().without_errors(), vehicle="mast").measure(state)
    assert np.abs(cloud.points_m).max() > 2.0
    with pytest.raises(SceneError, match="vehicle = 'mist': did you mean 'mast'"):
        ball_stage.open(LENS, vehicle="mist")


def test_a_carriers_own_shape_and_those_of_others_can_be_hidden(ball_stage):
    state = ball_stage.state([[-2.0, 0.0, 1.0], [0.0, 0.0, 1.0]], wxyz(Rotation.identity(2)))
    camera = ball_stage.open(LENS, vehicle="mast", hidden=("ball/shape",))
    assert np.isinf(range_ahead(camera, state))
    with pytest.raises(SceneError, match="hidden: 'bell/shape'"):
        ball_stage.open(LENS, vehicle="mast", hidden=("bell/shape",))


def test_axes_unit_and_order_of_quaternions_are_the_simulators():
    lifted = np.array([[0.0, 100.0, 0.0], [0.0, 100.0, 300.0]])  # y up, centimeters
    options = {"names": ["mast", "ball"], "up_axis": "y", "meters_per_unit": 0.01}
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    with BodyStage(STILL, {"ball": BALL}, quaternions="xyzw", **options) as stage:
        state = stage.state(np.hstack((lifted, turns)))
    np.testing.assert_allclose(state.world_from_object["ball"][:3, 3], (0.0, -3.0, 1.0), atol=1e-12)
    up = state.world_from_object["mast"][:3, 1]
    np.testing.assert_allclose(up, (0.0, 0.0, 1.0), atol=1e-12)


def test_an_order_that_fits_the_rest_pose_better_is_said_once(arm):
    rest = Rotation.from_euler("x", [[0.0], [0.3]])
    with BodyStage(STILL, {"arm": arm}, names=["base", "upper"], quaternions="xyzw") as stage:
        with pytest.warns(NoticeWarning, match="as 'wxyz' the first poses would be those at rest"):
            stage.state(POSITIONS, wxyz(rest))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            stage.state(POSITIONS, wxyz(rest))


def test_a_batch_has_a_state_for_each_world(ball_stage):
    positions = np.array([[[-2.0 - world, 0.0, 1.0], [0.0, 0.0, 1.0]] for world in range(3)])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (3, 2, 1))
    states = ball_stage.states(positions, turns, time_s=0.5)
    camera = ball_stage.open(LENS, vehicle="mast")
    arrays = camera.render_batch(states, channels=("rgb", "range"))
    middles = arrays["range"][:, 32, 32]
    np.testing.assert_allclose(middles, (1.5, 2.5, 3.5), atol=1e-3)
    single = camera.render(ball_stage.state(positions[1], turns[1], 0.5))
    np.testing.assert_array_equal(single.rgb, arrays["rgb"][1])
    with pytest.raises(OmnisimError, match="expected 3 worlds as before, got 2"):
        ball_stage.states(positions[:2], turns[:2])


def test_velocities_move_bodies_around_a_time(ball_stage):
    motion = ball_stage.motion(
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], wxyz(Rotation.from_euler("z", [[0.0], [0.5]])),
        linear=[[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]], angular=[[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]],
        time_s=10.0,
    )  # fmt: skip
    moved = motion(10.1).world_from_object["ball"]
    np.testing.assert_allclose(moved[:3, 3], (1.0, 0.2, 0.0), atol=1e-12)
    turn = Rotation.from_matrix(moved[:3, :3]).as_euler("zyx")
    np.testing.assert_allclose(turn, (0.8, 0.0, 0.0), atol=1e-12)
    assert motion(10.1).time_s == 10.1


@pytest.mark.parametrize(
    ("positions", "quaternions", "expected"),
    [
        ([[0, 0, 0], [0, np.nan, 0]], [[1, 0, 0, 0]] * 2, "body 'ball': expected a finite"),
        ([[0, 0, 0]] * 2, [[1, 0, 0, 0], [0, 0, 0, 0]], "body 'ball': expected .* unit quaternion"),
        ([[0, 0, 0]], [[1, 0, 0, 0]], r"positions: expected an array \(2, 3\), got \(1, 3\)"),
        ([[0, 0, 0]] * 2, [[1, 0, 0]] * 2, r"quaternions: expected an array \(2, 4\)"),
        ("here", None, "positions: expected numbers, got str"),
    ],
)
def test_arrays_that_are_no_poses_are_refused(ball_stage, positions, quaternions, expected):
    with pytest.raises(OmnisimError, match=expected):
        ball_stage.state(positions, quaternions)


def test_arrays_of_other_libraries_are_taken(ball_stage):
    class OnDevice:
        """As an array of torch."""

        def __init__(self, values):
            self.values = values

        def detach(self):
            return self

        def cpu(self):
            return self

        def numpy(self):
            return self.values

    positions, turns = np.zeros((2, 3), np.float32), np.tile(np.float32([1, 0, 0, 0]), (2, 1))
    state = ball_stage.state(OnDevice(positions), OnDevice(turns))
    np.testing.assert_array_equal(state.world_from_object["ball"], np.eye(4))


def test_names_are_matched_by_their_last_parts():
    links = ["go/base", "go/leg/foot", "arm/base"]
    found = match_names(links, ["World/go/base", "World/arm/base", "foot", "other"])
    assert found == {
        "go/base": "World/go/base", "arm/base": "World/arm/base", "go/leg/foot": "foot",
    }  # fmt: skip
    assert match_names(["base"], ["a/base", "b/base"]) == {}
    assert match_names(["model::link"], ["model/link"]) == {"model::link": "model/link"}


def test_links_without_a_body_are_named_with_the_nearest(arm):
    with BodyStage(STILL, {"arm": arm}, names=["arm/base", "arm/uper"]) as stage:
        lost, bare = stage.notices
    assert lost == "not drawn: no body moves 1 link: 'arm/upper' (did you mean 'arm/uper'?)"
    assert bare == "invisible: 1 body in no file: arm/uper"


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"names": ["a", "a"]}, "names: 'a': expected each body once"),
        ({"names": ["a"], "quaternions": "xyz"}, "quaternions = 'xyz'"),
        ({"names": ["a"], "up_axis": "up"}, "up axis: expected x, y or z"),
    ],
)
def test_impossible_options_are_refused(options, expected):
    with pytest.raises(OmnisimError, match=expected):
        BodyStage(STILL, **options)


def test_shapes_are_told_apart_and_have_their_colors():
    lamp = Shape(primitives.box((0.1, 0.1, 0.1)), omnisim.pose((0.0, 0.0, 1.0)), (0.0, 1.0, 0.0))
    scene = shape_scene("mast", [lamp, lamp])
    assert scene.instance_names == ("mast/shape", "mast/shape_2")
    assert scene.materials[0].base_color == (0.0, 1.0, 0.0, 1.0)
    np.testing.assert_allclose(scene.bounds_m()[:, 2], (0.9, 1.1))


def test_a_height_field_has_its_heights_over_a_rectangle():
    positions, triangles, _ = height_field([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]], 3.0, 1.0)
    np.testing.assert_allclose(positions[-1], (3.0, 1.0, 2.0))
    assert triangles.shape == (4, 3)


def test_what_a_robots_file_fixes_to_the_world_stands_still(tmp_path):
    path = tmp_path / "robot.sdf"
    visual = "<visual name='v'><geometry><box><size>1 1 1</size></box></geometry></visual>"
    path.write_text(
        f"<sdf version='1.9'><model name='m'><link name='moves'>{visual}</link>"
        f"<link name='post'>{visual}</link><joint name='j' type='fixed'>"
        "<parent>world</parent><child>post</child></joint></model></sdf>"
    )
    with BodyStage(STILL, {"robot": path}, names=["moves"]) as stage:
        assert stage.scene.instance_names == ("floor", "robot")
        assert list(stage.objects) == ["moves"]
    assert stage.notices == ()


def test_a_body_without_a_shape_is_no_notice_where_shapes_are_given_one_by_one(ball_stage):
    assert ball_stage.notices == ()


def test_a_sensor_without_a_carrier_stands_still_where_a_body_is_named_body():
    with BodyStage(STILL, {"body": BALL}, names=["body"]) as stage:
        state = stage.state([(1.0, 2.0, 3.0)], [(1.0, 0.0, 0.0, 0.0)])
        for vehicle, place in ((None, 0.0), ("body", 2.0)):
            frame = stage.open(LENS, vehicle=vehicle).render(state)
            assert frame.metadata["world_from_base"][1][3] == place
