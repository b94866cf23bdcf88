"""Importers of robot models from other simulators, and the robot files they write."""
