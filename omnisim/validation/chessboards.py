"""Chessboards around the camera, one per image, as for a calibration."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import rotation_from_roll_pitch_yaw
from omnisim.scene import Scene
from omnisim.validation.plain_scenes import BLACK, WHITE, plain_scene, quads

PATTERN = (8, 6)  # inner corners along a row, and rows
SQUARE_M = 0.08


def board_corners_m() -> NDArray[np.float64]:
    """Inner corners (n, 3) in the board's frame: x along a row, y along a column, z = 0."""
    columns, rows = PATTERN
    y, x = np.mgrid[:rows, :columns]
    middle = 0.5 * np.array([columns - 1, rows - 1])
    flat = (np.stack((x.ravel(), y.ravel()), axis=1) - middle) * SQUARE_M
    return np.concatenate((flat, np.zeros((len(flat), 1))), axis=1)


def board_poses(count: int, seed: int = 11) -> list[NDArray[np.float64]]:
    """Random poses (4, 4) rig_from_board of tilted boards, 10° to 65° below the horizon."""
    random = np.random.default_rng(seed)
    poses = []
    for index in range(count):
        azimuth = 2.0 * math.pi * (index * 0.381966 + 0.03 * random.normal())
        incidence = math.radians(random.uniform(25.0, 80.0))
        outward = np.array(
            [
                math.sin(incidence) * math.cos(azimuth),
                math.sin(incidence) * math.sin(azimuth),
                -math.cos(incidence),
            ]
        )
        side = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        facing = np.stack((side, np.cross(outward, side), outward), axis=1)
        roll, pitch, yaw = random.uniform(-0.6, 0.6, 3)
        pose = np.eye(4)
        pose[:3, :3] = facing @ rotation_from_roll_pitch_yaw(roll, pitch, 2.0 * yaw)
        pose[:3, 3] = outward * random.uniform(0.55, 0.9)
        poses.append(pose)
    return poses


def board_poses_in_front(count: int, max_rad: float, seed: int = 7) -> list[NDArray[np.float64]]:
    """Random poses (4, 4) optical_from_board of tilted boards, up to `max_rad` off the axis."""
    random = np.random.default_rng(seed)
    poses = []
    for index in range(count):
        azimuth = 2.0 * math.pi * (index * 0.381966 + 0.03 * random.normal())
        theta = max_rad * math.sqrt((index + 0.5) / count)
        across = math.sin(theta)
        outward = np.array(
            [across * math.cos(azimuth), across * math.sin(azimuth), math.cos(theta)]
        )
        side = np.cross([0.0, 1.0, 0.0], outward)
        side /= np.linalg.norm(side)
        facing = np.stack((side, np.cross(outward, side), outward), axis=1)
        pose = np.eye(4)
        pose[:3, :3] = facing @ rotation_from_roll_pitch_yaw(*random.uniform(-0.5, 0.5, 3))
        pose[:3, 3] = outward * random.uniform(0.9, 1.4)
        poses.append(pose)
    return poses


def board_scene() -> Scene:
    """Scene of an unlit chessboard with a white border, in the board's frame, on black."""
    columns, rows = PATTERN[0] + 1, PATTERN[1] + 1
    white: list[NDArray[np.float64]] = []
    black: list[NDArray[np.float64]] = []
    for row in range(-1, rows + 1):
        for column in range(-1, columns + 1):
            corner = np.array([column - 0.5 * columns, row - 0.5 * rows])
            square = SQUARE_M * (corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))
            inside = 0 <= row < rows and 0 <= column < columns
            (black if inside and (row + column) % 2 else white).append(square)

    def placed(squares: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        flat = np.stack(squares)
        return np.concatenate((flat, np.zeros((*flat.shape[:2], 1))), axis=2)

    return plain_scene(
        "chessboard",
        (quads("white", placed(white)), WHITE),
        (quads("black", placed(black), 1), BLACK),
    )
