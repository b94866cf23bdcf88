"""Robots out of USARSim's configuration, USARBot.ini, as robot files."""
