"""Robots from Gazebo models, as robot files."""
