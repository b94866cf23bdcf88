"""Import of robots from USARSim's configuration file, USARBot.ini."""

from omnisim.robots.importers.usarsim.usarsim_robot import import_robot

__all__ = ["import_robot"]
