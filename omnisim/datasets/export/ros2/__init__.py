"""ROS 2 bags, written without ROS; frames follow REP 103 and 105."""
