"""Robots out of Gazebo's models, as robot files."""

from omnisim.simulation.gazebo.robot_import import SUFFIXES, import_model

__all__ = ["SUFFIXES", "import_model"]
