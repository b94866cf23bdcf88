"""Robots out of USARSim's configuration, USARBot.ini, as robot files."""

from omnisim.robots.importers.usarsim.usarsim_robot import ImportedRobot, import_robot

__all__ = ["ImportedRobot", "import_robot"]
