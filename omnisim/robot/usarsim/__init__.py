"""Robots out of USARSim's configuration, USARBot.ini, as robot files."""

from omnisim.robot.usarsim.robot_import import ImportedRobot, import_robot

__all__ = ["ImportedRobot", "import_robot"]
