"""ROS 2 node in a process of its own, by zenoh-ros2-sdk: reads topics, commands, calls services.

`python -m tests.serve.ros_client '{"port": 7447, "topics": {"/odom": "nav_msgs/msg/Odometry"}}'`
prints what it has received and been answered, as JSON.
"""

import json
import sys
import tempfile
import time
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

WITHIN_S = 30
EMPTY = "uint8 structure_needs_at_least_one_member"
ANSWER = "bool success\nstring message"


def plain(value):
    """A message as JSON has it."""
    if is_dataclass(value):
        named = (field for field in fields(value) if not field.name.startswith("__"))
        return {field.name: plain(getattr(value, field.name)) for field in named}
    if isinstance(value, np.void):  # a record
        return {name: plain(value[name]) for name in value.dtype.names}
    if isinstance(value, (list, np.ndarray)):
        return [plain(each) for each in value]
    return value.item() if isinstance(value, np.generic) else value


def write_definitions(folder):
    """Definitions that the SDK otherwise clones from GitHub."""
    from rosbags.typesys import Stores, get_typestore

    from omnisim.datasets.export.ros2.ros_messages import LIVOX, STORE

    store = get_typestore(Stores.ROS2_JAZZY)
    store.register({x: y for x, y in STORE.fielddefs.items() if x.startswith(LIVOX)})
    for type_name in store.fielddefs:
        text, _ = store.generate_msgdef(type_name, ros_version=2)
        path = Path(folder, f"{type_name}.msg")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.split("=" * 80)[0], encoding="utf-8")


def _until(condition):
    end_s = time.monotonic() + WITHIN_S
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.02)


def main(request, folder):
    import zenoh_ros2_sdk as sdk
    from zenoh_ros2_sdk.message_registry import get_registry
    from zenoh_ros2_sdk.qos import QosDurability, QosProfile
    from zenoh_ros2_sdk.session import ZenohSession

    at = {"router_ip": "127.0.0.1", "router_port": request["port"]}
    session = ZenohSession.get_instance(**at)
    write_definitions(folder)
    get_registry().messages_dir = Path(folder)
    received = {}
    for name, (type_name, is_latched) in request["topics"].items():
        latched = QosDurability.TRANSIENT_LOCAL if is_latched else QosDurability.VOLATILE
        sdk.ROS2Subscriber(
            name, type_name, lambda message, name=name: received.setdefault(name, message),
            qos=QosProfile(durability=latched), **at,
        )  # fmt: skip
    _until(lambda: received.keys() == request["topics"].keys())

    def new(type_name, **values):
        return session.store.types[type_name](**values)

    def vector(x=0.0, y=0.0, z=0.0):
        return new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    drive = sdk.ROS2Publisher("/cmd_vel", "geometry_msgs/msg/Twist", **at)
    stamped = sdk.ROS2Publisher("/cmd_vel", "geometry_msgs/msg/TwistStamped", **at)
    name = "geometry_msgs/msg/PoseWithCovarianceStamped"
    place = sdk.ROS2Publisher("/set_pose", name, **at)
    time.sleep(1)  # until they are connected
    drive.publish(linear=vector(x=0.5), angular=vector(z=0.25))
    header = new(
        "std_msgs/msg/Header",
        stamp=new("builtin_interfaces/msg/Time", sec=0, nanosec=0),
        frame_id="base_link",
    )
    time.sleep(0.2)
    twist = new("geometry_msgs/msg/Twist", linear=vector(x=-1.0), angular=vector())
    stamped.publish(header=header, twist=twist)
    pose = new(
        "geometry_msgs/msg/Pose",
        position=new("geometry_msgs/msg/Point", x=1.0, y=2.0, z=0.0),
        orientation=new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.6, w=0.8),
    )
    covariance = new("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36))
    place.publish(header=header, pose=covariance)

    def call(name, type_name, asked, answered, **values):
        client = sdk.ROS2ServiceClient(name, type_name, asked, answered, timeout=WITHIN_S, **at)
        time.sleep(0.3)
        return plain(client.call(**values))

    nothing = {"structure_needs_at_least_one_member": 0}
    answers = {
        "/pause": call("/pause", "std_srvs/srv/SetBool", "bool data", ANSWER, data=True),
        "/step": call("/step", "std_srvs/srv/Trigger", EMPTY, ANSWER, **nothing),
        "/reset": call("/reset", "std_srvs/srv/Empty", EMPTY, EMPTY, **nothing),
    }
    listed = sdk.get_topic_names_and_types(**at), sdk.get_service_names_and_types(**at)
    messages = {name: plain(message) for name, message in received.items()}
    print(json.dumps({"messages": messages, "answers": answers, "listed": listed}))
    session.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as definitions:
        main(json.loads(sys.argv[1]), definitions)
