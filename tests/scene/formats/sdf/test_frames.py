"""Poses and frames against poses made by scipy and by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.errors import SceneError
from tests.scene.formats.sdf.worlds import BOX, load, model, sdf, visual, world, write_model


def pose(position, roll=0.0, pitch=0.0, yaw=0.0):
    """Pose by scipy: fixed axes x, y, z."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", (roll, pitch, yaw)).as_matrix()
    matrix[:3, 3] = position
    return matrix


def node_pose(scene, name):
    return next(instance.world_from_node for instance in scene.instances if instance.name == name)


A, B, C = (1, 2, 3, 0.1, -0.2, 0.3), (0, -1, 2, 0.4, 0.5, -0.6), (2, 0, 1, -0.7, 0.8, 0.9)


def text(values, **attributes):
    words = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<pose{words}>{' '.join(map(str, values))}</pose>"


def matrix(values):
    return pose(values[:3], *values[3:])


def test_poses_of_model_link_and_visual_are_multiplied(tmp_path):
    inner = f'<link name="l">{text(B)}{visual(BOX, rest=text(C))}</link>'
    scene = load(tmp_path, world(f'<model name="m">{text(A)}{inner}</model>'))
    assert [instance.name for instance in scene.instances] == ["m/l/visual"]
    assert node_pose(scene, "m/l/visual") == pytest.approx(matrix(A) @ matrix(B) @ matrix(C))


def test_angles_in_degrees_and_quaternions(tmp_path):
    degrees = (*A[:3], *np.degrees(A[3:]))
    turned = (*B[:3], *Rotation.from_euler("xyz", B[3:]).as_quat())
    models = model("a", visual(BOX), text(degrees, degrees="true"))
    models += model("b", visual(BOX), text(turned, rotation_format="quat_xyzw"))
    scene = load(tmp_path, world(models))
    assert node_pose(scene, "a/link/visual") == pytest.approx(matrix(A))
    assert node_pose(scene, "b/link/visual") == pytest.approx(matrix(B))


def test_poses_relative_to_frames_links_and_joints(tmp_path):
    inner = (
        f'<link name="l">{visual(BOX, rest=text(A, relative_to="joint"))}</link>'
        f'<link name="k">{text(B)}</link>'
        f'<frame name="f" attached_to="k">{text(C)}</frame>'
        f'<joint name="joint" type="fixed"><child>k</child>{text(A, relative_to="f")}</joint>'
    )
    scene = load(tmp_path, world(f'<model name="m">{text(C)}{inner}</model>'))
    joint = matrix(B) @ matrix(C) @ matrix(A)
    assert node_pose(scene, "m/l/visual") == pytest.approx(matrix(C) @ joint @ matrix(A))


def test_frames_of_the_world_and_of_nested_models(tmp_path):
    nested = f'<model name="n">{text(B)}<frame name="f">{text(C)}</frame>{model_link()}</model>'
    scene = load(
        tmp_path,
        world(
            f'<frame name="table" attached_to="m::n::f">{text(A)}</frame>'
            f'<model name="m">{text(A)}{nested}</model>'
            + model("cup", visual(BOX), text(B, relative_to="table"))
        ),
    )
    frame = matrix(A) @ matrix(B) @ matrix(C)
    assert node_pose(scene, "m/n/link/visual") == pytest.approx(matrix(A) @ matrix(B))
    assert node_pose(scene, "cup/link/visual") == pytest.approx(frame @ matrix(A) @ matrix(B))


def model_link():
    return f'<link name="link">{visual(BOX)}</link>'


def test_a_placement_frame_is_where_the_pose_says(tmp_path):
    inner = f'<frame name="f">{text(B)}</frame>{model_link()}'
    scene = load(tmp_path, world(f'<model name="m" placement_frame="f">{text(A)}{inner}</model>'))
    expected = matrix(A) @ np.linalg.inv(matrix(B))
    assert node_pose(scene, "m/link/visual") == pytest.approx(expected)


def test_an_include_overrides_pose_name_and_placement(tmp_path):
    inner = f'<model name="chair">{text(C)}<frame name="f">{text(B)}</frame>{model_link()}</model>'
    write_model(tmp_path / "models", "chair", inner)
    include = "<uri>model://chair</uri>"
    scene = load(
        tmp_path,
        world(
            f"<include>{include}</include>"
            f"<include>{include}<name>two</name>{text(A)}</include>"
            f"<include>{include}<name>three</name>{text(A)}"
            "<placement_frame>f</placement_frame></include>"
            f"<include>{include}</include>"
        ),
    )
    assert node_pose(scene, "chair/link/visual") == pytest.approx(matrix(C))
    assert node_pose(scene, "two/link/visual") == pytest.approx(matrix(A))
    expected = matrix(A) @ np.linalg.inv(matrix(B))
    assert node_pose(scene, "three/link/visual") == pytest.approx(expected)
    assert "chair_0/link/visual" in scene.instance_names


def test_a_merged_model_has_the_names_of_its_outer_one(tmp_path):
    write_model(tmp_path / "models", "base", f'<model name="base">{model_link()}</model>')
    inner = (
        f'<include merge="true"><uri>model://base</uri>{text(B)}</include>'
        f'<link name="top">{text(C, relative_to="link")}{visual(BOX)}</link>'
    )
    scene = load(tmp_path, world(f'<model name="robot">{text(A)}{inner}</model>'))
    assert node_pose(scene, "robot/link/visual") == pytest.approx(matrix(A) @ matrix(B))
    expected = matrix(A) @ matrix(B) @ matrix(C)
    assert node_pose(scene, "robot/top/visual") == pytest.approx(expected)


def test_a_saved_state_is_where_everything_is(tmp_path):
    nested = f'<model name="n">{model_link()}</model>'
    state = (
        f'<state world_name="default"><model name="m">{text(A)}<scale>1 1 1</scale>'
        f'<link name="link">{text(B)}</link><model name="n">{text(C)}</model></model>'
        '<model name="gone"><pose>1 2 3 0 0 0</pose></model>'
        f'<light name="lamp">{text(A)}</light></state>'
    )
    lamp = '<light name="lamp" type="point"/>'
    inner = f'<model name="m">{text(C)}{model_link()}{nested}</model>'
    scene = load(tmp_path, world(inner + lamp + state, "1.6"))
    assert node_pose(scene, "m/link/visual") == pytest.approx(matrix(B))
    assert node_pose(scene, "m/n/link/visual") == pytest.approx(matrix(C))
    assert scene.lighting.lights[0].position_m == pytest.approx(A[:3])


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        (
            '<frame name="a"><pose relative_to="b"/></frame>'
            '<frame name="b"><pose relative_to="a">1 0 0 0 0 0</pose></frame>'
            '<link name="l"><pose relative_to="a"/></link>',
            "expected frames that are not relative to themselves, got 'a → b → a'",
        ),
        (
            '<link name="l"><pose relative_to="tabel"/></link><frame name="table"/>',
            "expected the name of a frame; did you mean 'table'?, got 'tabel'",
        ),
        ('<link name="l"><pose>1 2 3</pose></link>', "pose: expected 6 numbers, got '1 2 3'"),
        (
            '<link name="l"><pose rotation_format="quat_xyzw">0 0 0 0 0 0 0</pose></link>',
            "expected a quaternion other than 0",
        ),
    ],
)
def test_a_pose_that_is_none_is_named(tmp_path, inner, message):
    inner = inner.replace("</link>", f"{visual(BOX)}</link>")
    with pytest.raises(SceneError) as info:
        load(tmp_path, sdf(f'<model name="m">{inner}</model>'))
    assert message in str(info.value)
    assert "model[m]/" in str(info.value)


@pytest.mark.parametrize("frame", ["cup", "mug", "__model__", "cup::f", "mug::f"])
def test_a_placement_frame_may_name_the_include_itself(frame, tmp_path):
    inner = f'<frame name="f"><pose>0 0 5 0 0 0</pose></frame><link name="l">{visual(BOX)}</link>'
    write_model(tmp_path, "cup_model", f'<model name="mug">{inner}</model>')
    include = (
        "<include><name>cup</name><uri>cup_model</uri><pose>1 2 3 0 0 0</pose>"
        f"<placement_frame>{frame}</placement_frame></include>"
    )
    scene = load(tmp_path, world(include))
    z = -2.0 if frame.endswith("::f") else 3.0
    np.testing.assert_allclose(scene.instances[0].world_from_mesh[:3, 3], (1, 2, z))
