"""Worlds and models of Gazebo: SDFormat 1.4 to 1.12, visuals and lights.

Source: SDFormat's specification, http://sdformat.org/spec.
"""
