"""Robots out of Gazebo's models, as robot files."""
