"""Robots of URDF: their visuals in the pose in which all joints are at rest.

Modules import in one direction: `kinematics`, `reader`. No extra is needed.
"""
