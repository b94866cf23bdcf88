"""Simulated robots as live streams: for Foxglove, ROS 2 nodes, and programs of any kind."""
