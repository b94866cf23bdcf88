"""Small worlds for physics: ground, objects that are free, and a robot."""

import numpy as np
import trimesh

from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.physics.convex_pieces import ConvexPiece, SolidShape
from omnisim.runs.physics.rover import Rover
from omnisim.scene import Scene
from omnisim.scene.model import DynamicObject
from omnisim.scene.motion.object_motion import FreeBody

ROBOT = {
    "name": "cart",
    "kinematics": {
        "type": "skid_steer",
        "track_m": 0.4,
        "wheelbase_m": 0.3,
        "wheel_diameter_m": 0.2,
        "max_speed_mps": 1.0,
        "max_turn_rate_degps": 90.0,
        "max_acceleration_mps2": 0.5,
        "max_turn_acceleration_degps2": 90.0,
    },
    "footprint": {"length_m": 0.6, "width_m": 0.5, "height_m": 0.3},
    "physics": {"mass_kg": 10.0, "center_height_m": 0.1},
}


def robot(drive="skid_steer", **physics):
    """Robot on wheels, of a table."""
    table = {**ROBOT, "kinematics": {**ROBOT["kinematics"], "type": drive}}
    table["physics"] = {**ROBOT["physics"], **physics}
    return parse_robot(table, "cart.toml")


def rover(drive="skid_steer", **physics):
    """The same, for physics."""
    found = robot(drive, **physics)
    return Rover.of(Vehicle.from_robot(found), found.chassis)


def block(extents_m, pose=None, name="block"):
    """Piece that is a box about a pose."""
    corners = trimesh.creation.box(extents_m, transform=pose).vertices
    return ConvexPiece(name, SolidShape.of(np.array(corners)))


def ground():
    """Piece whose top is at a height of 0."""
    pose = np.eye(4)
    pose[2, 3] = -0.5
    return block((100.0, 100.0, 1.0), pose, "ground")


def solid(mesh, name="solid"):
    """Scene of a mesh of trimesh's."""
    return Scene.from_trimesh(mesh, name)


def hall(*others):
    """Scene of a floor about the origin, and other scenes by name and pose."""
    floor = trimesh.Trimesh(
        [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2), (0, 2, 3)]
    )
    scene = Scene.from_trimesh(floor, "floor")
    for name, part, position_m in others:
        pose = np.eye(4)
        pose[:3, 3] = position_m
        scene = scene.added(name, part, pose)
    return scene


def ball(position_m, mass_kg=0.4, radius_m=0.1, name="ball"):
    """Ball that is free to move."""
    shape = solid(trimesh.creation.icosphere(3, radius_m), name)
    return DynamicObject(name, shape, FreeBody(tuple(position_m), 0.0, mass_kg))
