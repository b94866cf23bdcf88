"""Stages that follow a bag's transforms, written here with rosbags alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.errors import SceneError
from omnisim.follow import BagStage, Shape, shape_scene
from omnisim.scene import primitives

rosbags = pytest.importorskip("rosbags", reason="rosbags, which writes bags, is missing")

BALL = shape_scene("ball", [Shape(primitives.ellipsoid((0.5, 0.5, 0.5)))])
STILL = shape_scene("", [Shape(primitives.rectangle(5.0, 5.0))])


@pytest.fixture
def write(tmp_path):
    """Write a bag of (time, parent, child, position, yaw); without a time it is static."""

    def write(transforms):
        from rosbags.rosbag2 import Writer
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS2_HUMBLE)
        types = store.types
        path = tmp_path / "bag"
        with Writer(path, version=9) as writer:
            topics = {
                topic: writer.add_connection(topic, "tf2_msgs/msg/TFMessage", typestore=store)
                for topic in ("/tf", "/tf_static")
            }
            for time_s, parent, child, position, yaw in transforms:
                ns = round((time_s or 0.0) * 1e9)
                stamp = types["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
                turn = Rotation.from_rotvec((0.0, 0.0, yaw)).as_quat()
                message = types["tf2_msgs/msg/TFMessage"]([
                    types["geometry_msgs/msg/TransformStamped"](
                        types["std_msgs/msg/Header"](stamp, parent), child,
                        types["geometry_msgs/msg/Transform"](
                            types["geometry_msgs/msg/Vector3"](*map(float, position)),
                            types["geometry_msgs/msg/Quaternion"](*map(float, turn)),
                        ),
                    )
                ])  # fmt: skip
                topic = "/tf_static" if time_s is None else "/tf"
                data = store.serialize_cdr(message, "tf2_msgs/msg/TFMessage")
                writer.write(topics[topic], ns, data)
        return path

    return write


TREE = [
    (None, "arm", "ball", (0, 0, 1), 0.0),
    (1.0, "world", "base", (0, 0, 0), 0.0),
    (2.0, "world", "base", (2, 0, 0), np.pi / 2),
    (1.5, "base", "arm", (1, 0, 0), 0.0),
]


def test_bodies_follow_the_tree_of_frames_between_its_stamps(write):
    with BagStage(write(TREE), STILL, {"ball": BALL}) as stage:
        np.testing.assert_allclose(stage.times_s, (1.0, 1.5, 2.0))
        middle = stage.at(1.5).world_from_object["ball"]
        after = stage.at(9.0).world_from_object["ball"]
    half = np.sqrt(0.5)
    np.testing.assert_allclose(middle[:3, 3], (1.0 + half, half, 1.0), atol=1e-9)
    np.testing.assert_allclose(after[:3, 3], (2.0, 1.0, 1.0), atol=1e-9)
    assert not stage.notices


def test_a_fixed_frame_is_the_scenes_world(write):
    bag = write([*TREE, (1.0, "elsewhere", "other", (0, 0, 0), 0.0)])
    with pytest.raises(SceneError, match="frames without a parent: elsewhere, world: choose"):
        BagStage(bag, STILL)
    with pytest.raises(SceneError, match="fixed_frame = 'wold': did you mean 'world'"):
        BagStage(bag, STILL, fixed_frame="wold")
    with BagStage(bag, STILL, {"ball": BALL}, fixed_frame="base") as stage:
        assert stage.names == ("ball", "base", "arm")
        place = stage.at(2.0).world_from_object["ball"][:3, 3]
        np.testing.assert_allclose(place, (1.0, 0.0, 1.0), atol=1e-12)


def test_bags_without_transforms_are_refused(write, tmp_path):
    with pytest.raises(SceneError, match="no such file or folder"):
        BagStage(tmp_path / "none", STILL)
    with pytest.raises(SceneError, match=r"expected transforms \(/tf\), got none"):
        BagStage(write([]), STILL)
    (tmp_path / "bag" / "metadata.yaml").write_text("?")
    with pytest.raises(SceneError, match="cannot be read as a bag"):
        BagStage(tmp_path / "bag", STILL)


def test_a_missing_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: False)
    with pytest.raises(SceneError, match="needs rosbags: pip install"):
        BagStage(tmp_path, STILL)
