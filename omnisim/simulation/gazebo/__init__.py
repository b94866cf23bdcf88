"""Robots out of Gazebo's models, as robot files."""

from omnisim.simulation.gazebo.robot_import import SUFFIXES, ImportedModel, import_model

__all__ = ["SUFFIXES", "ImportedModel", "import_model"]
