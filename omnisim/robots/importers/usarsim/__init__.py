"""Robots out of USARSim's configuration, USARBot.ini."""

from omnisim.robots.importers.usarsim.usarsim_robot import import_robot

__all__ = ["import_robot"]
