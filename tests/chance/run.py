"""Scenes by number: each one's world, and the sensors that are tried in it."""

from collections import Counter

import numpy as np

from tests.chance.checks import check_camera, check_lidar
from tests.chance.sensors import LENSES, OPTICS, lens_by_chance, lidar_by_chance, optics_by_chance
from tests.chance.worlds import world_by_chance

FASTEST_MPS = 10.0


def check_lens_scene(seed, number):
    """A world seen by the lens whose turn it is."""
    random = np.random.default_rng((seed, number, 0))
    kind = list(LENSES)[number % len(LENSES)]
    world = world_by_chance(random)
    return check_camera(world, lens_by_chance(random, kind), f"{seed}:{number} {kind}")


def check_optics_scene(seed, number):
    """A world seen by the optical system whose turn it is."""
    random = np.random.default_rng((seed, number, 1))
    kind = OPTICS[number % len(OPTICS)]
    world = world_by_chance(random)
    return check_camera(world, optics_by_chance(random, kind), f"{seed}:{number} {kind}")


def check_lidar_scene(seed, number, most_rings=128):
    """A world with objects of up to 10 m/s, scanned by a lidar."""
    random = np.random.default_rng((seed, number, 2))
    world = world_by_chance(random, FASTEST_MPS, fewest_moving=2)
    lidar = lidar_by_chance(random, most_rings)
    return check_lidar(world, lidar, f"{seed}:{number} lidar of {lidar.rings} rings")


KINDS = {"lenses": check_lens_scene, "optics": check_optics_scene, "lidars": check_lidar_scene}


def check_scenes(kind, seed, numbers):
    """Sum of the counts, and all differences, of some scenes of a kind."""
    counts, findings = Counter(), []
    for number in numbers:
        some, lines = KINDS[kind](seed, number)
        counts += some
        findings += lines
    return counts, findings
