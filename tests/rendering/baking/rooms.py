"""Rooms whose light is known."""

import dataclasses

import numpy as np

from omnisim.scene import Scene
from omnisim.scene.model import Lighting, StartPose

DARK = Lighting((0.0, 0.0, 0.0), ())


def box(name, size_m, center_m=(0.0, 0.0, 0.0), color=(0.5, 0.5, 0.5), inwards=False):
    """A closed box, whose corners belong to one side each."""
    corners, triangles = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            across = np.roll(np.eye(3), 1, axis=0)[axis], np.roll(np.eye(3), 2, axis=0)[axis]
            u, v = across if (sign > 0) != inwards else across[::-1]
            base = sign * np.eye(3)[axis]
            if np.dot(np.cross(u, v), base) * (-1 if inwards else 1) < 0:
                u, v = v, u
            first = len(corners)
            corners += [base - u - v, base + u - v, base + u + v, base - u + v]
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    positions = 0.5 * np.array(corners) * size_m + center_m
    return Scene.from_arrays(name, positions, triangles, base_color=color, double_sided=False)


def lit_by(scene, lighting=DARK, start_m=(0.0, 0.0, 0.0)):
    return dataclasses.replace(scene, lighting=lighting, start=StartPose(start_m))


def shining(scene, light, number=0):
    materials = list(scene.materials)
    materials[number] = dataclasses.replace(materials[number], emissive=(light,) * 3)
    return dataclasses.replace(scene, materials=tuple(materials))


def black_room(lighting=DARK):
    return lit_by(box("room", (4.0, 4.0, 3.0), color=(0.0, 0.0, 0.0), inwards=True), lighting)
