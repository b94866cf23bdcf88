"""URDF robots: their visuals, posed with all joints at rest.

`omnisim.robots.importers.urdf_robot` reads wheels, masses and sensors. No extra is required.
"""
