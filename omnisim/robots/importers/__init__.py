"""Importers of robot models from other simulators, and the robot files they write.

They raise a RobotFileError that names the file, the element or entry, and its value.
"""
