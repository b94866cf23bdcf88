"""URDF robots: their visuals, posed with all joints at rest.

Modules import in one direction: `kinematics`, `reader`. No extra is required.
"""
