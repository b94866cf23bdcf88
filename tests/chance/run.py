"""Scenes by number: each one's world, and the sensors that are tried in it."""

from collections import Counter

import numpy as np

from tests.chance import sensors
from tests.chance.checks import check_camera, check_lidar
from tests.chance.worlds import world_by_chance

KINDS = ("lenses", "optics", "lidars")
FASTEST_MPS = 10.0  # objects of lidars


def check_scene(kind, seed, number):
    """A world seen by the lens or optical system whose turn it is, or scanned by a lidar."""
    random = np.random.default_rng((seed, number, KINDS.index(kind)))
    if kind == "lidars":
        world = world_by_chance(random, FASTEST_MPS, fewest_moving=2)
        lidar = sensors.lidar_by_chance(random)
        return check_lidar(world, lidar, f"{seed}:{number} lidar of {lidar.rings} rings")
    world = world_by_chance(random)
    names, make = {
        "lenses": (tuple(sensors.LENSES), sensors.lens_by_chance),
        "optics": (sensors.OPTICS, sensors.optics_by_chance),
    }[kind]
    name = names[number % len(names)]
    return check_camera(world, make(random, name), f"{seed}:{number} {name}")


def check_scenes(kind, seed, numbers):
    """Sum of the counts, and all differences, of some scenes of a kind."""
    counts, findings = Counter(), []
    for number in numbers:
        some, lines = check_scene(kind, seed, number)
        counts += some
        findings += lines
    return counts, findings
