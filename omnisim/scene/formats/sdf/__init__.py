"""Gazebo worlds and models: visuals and lights of SDFormat 1.4 to 1.12.

Source: SDFormat specification, http://sdformat.org/spec.
"""
