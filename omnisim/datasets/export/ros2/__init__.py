"""ROS 2 bags: messages, topics and frames by REP 103 and 105, without ROS."""
