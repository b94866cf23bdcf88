"""ROS 2 bags, written without ROS; frames follow REP 103 and 105."""

from typing import Literal

# Layouts of lidar clouds, see `cloud_layouts`.
CloudLayout = Literal["generic", "velodyne", "ouster", "ouster-u8", "livox", "livox-custom"]
