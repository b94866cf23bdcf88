"""Scenes of a few plain shapes at exactly known positions, on black, and of chessboards."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.poses import rotation_from_roll_pitch_yaw
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose
from omnisim.validation.fixture import Fixture
from omnisim.validation.oracles import omnidir

WHITE = (1.0, 1.0, 1.0, 1.0)
BLACK = (0.0, 0.0, 0.0, 1.0)
PATTERN = (8, 6)  # inner corners along a row, and rows
SQUARE_M = 0.08


def plain_scene(name: str, *colored: tuple[Mesh, tuple[float, float, float, float]]) -> Scene:
    """Scene of meshes in the world frame, each in one linear RGBA color, on black."""
    return Scene(
        name=name,
        meshes=tuple(mesh for mesh, _ in colored),
        materials=tuple(
            Material(base_color=color, double_sided=True, unlit=True) for _, color in colored
        ),
        instances=tuple(
            Instance(mesh.name, index, np.eye(4)) for index, (mesh, _) in enumerate(colored)
        ),
        lighting=Lighting((1.0, 1.0, 1.0), ()),
        background=(0.0, 0.0, 0.0),
        start=StartPose((0.0, 0.0, 0.0)),
    )


def discs(
    name: str,
    middles_m: Floats,
    viewpoint_m: ArrayLike,
    angular_radius_rad: float,
    material: int = 0,
    corners: int = 24,
) -> Mesh:
    """Mesh of discs at points (n, 3), world frame, of equal angular size, facing the viewpoint."""
    toward = middles_m - np.asarray(viewpoint_m, dtype=np.float64)
    ranges = np.linalg.norm(toward, axis=1, keepdims=True)
    toward = toward / ranges
    helper = np.where(np.abs(toward[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.cross(helper, toward)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(toward, across)
    angles = 2.0 * np.pi * np.arange(corners) / corners
    circle = np.cos(angles)[:, None, None] * across + np.sin(angles)[:, None, None] * up
    rims = middles_m + circle * ranges * np.tan(angular_radius_rad)
    count = len(middles_m)
    positions = np.concatenate((middles_m, rims.reshape(-1, 3)))
    disc = np.arange(count)
    triangles = [
        np.stack((disc, count * (1 + k) + disc, count * (1 + (k + 1) % corners) + disc), axis=1)
        for k in range(corners)
    ]
    return Mesh(name, positions.astype("f4"), np.concatenate(triangles).astype("u4"), material)


def quads(name: str, corners_m: ArrayLike, material: int = 0) -> Mesh:
    """Mesh of quadrilaterals with corners (n, 4, 3) in the world frame, in order around each."""
    corners = np.asarray(corners_m, dtype=np.float64)
    first = 4 * np.arange(len(corners))[:, None]
    triangles = np.concatenate((first + [0, 1, 2], first + [0, 2, 3]))
    return Mesh(name, corners.reshape(-1, 3).astype("f4"), triangles.astype("u4"), material)


def board_corners_m() -> Floats:
    """Inner corners (n, 3) in the board's frame: x along a row, y along a column, z = 0."""
    columns, rows = PATTERN
    y, x = np.mgrid[:rows, :columns]
    middle = 0.5 * np.array([columns - 1, rows - 1])
    flat = (np.stack((x.ravel(), y.ravel()), axis=1) - middle) * SQUARE_M
    return np.concatenate((flat, np.zeros((len(flat), 1))), axis=1)


def board_poses(count: int, seed: int = 11) -> list[Floats]:
    """Random poses (4, 4) rig_from_board of tilted boards, 10° to 65° below the horizon."""
    random = np.random.default_rng(seed)
    poses = []
    for index in range(count):
        azimuth = 2.0 * math.pi * (index * 0.381966 + 0.03 * random.normal())
        incidence = math.radians(random.uniform(25.0, 80.0))
        across = math.sin(incidence)
        outward = np.array(
            [across * math.cos(azimuth), across * math.sin(azimuth), -math.cos(incidence)]
        )
        side = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        facing = np.stack((side, np.cross(outward, side), outward), axis=1)
        roll, pitch, yaw = random.uniform(-0.6, 0.6, 3)
        pose = np.eye(4)
        pose[:3, :3] = facing @ rotation_from_roll_pitch_yaw(roll, pitch, 2.0 * yaw)
        pose[:3, 3] = outward * random.uniform(0.55, 0.9)
        poses.append(pose)
    return poses


def board_poses_in_front(count: int, max_rad: float, seed: int = 7) -> list[Floats]:
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


class DetectedBoards(NamedTuple):
    """Images (height, width, 3) with a detected board, and the corners (n, 2) in each."""

    images: list[Bytes]
    corners: list[Floats]


def detected_boards(fixture: Fixture, sensor: OmniCamera, count: int) -> DetectedBoards:
    """Render boards at random poses, and detect their corners by OpenCV."""
    detected = DetectedBoards([], [])
    with open_sensor(board_scene(), sensor, unlit=True, device=fixture.device) as renderer:
        for rig_from_board in board_poses(count):
            image = renderer.render(np.linalg.inv(rig_from_board)).rgb
            corners = omnidir.find_corners(np.ascontiguousarray(image[..., 1]), PATTERN)
            if corners is not None:
                detected.images.append(image)
                detected.corners.append(corners)
    return detected


def board_scene() -> Scene:
    """Scene of an unlit chessboard with a white border, in the board's frame, on black."""
    columns, rows = PATTERN[0] + 1, PATTERN[1] + 1
    white, black = list[Floats](), list[Floats]()
    for row in range(-1, rows + 1):
        for column in range(-1, columns + 1):
            corner = np.array([column - 0.5 * columns, row - 0.5 * rows])
            square = SQUARE_M * (corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))
            inside = 0 <= row < rows and 0 <= column < columns
            (black if inside and (row + column) % 2 else white).append(square)

    def mesh(name: str, squares: list[Floats], material: int) -> Mesh:
        return quads(name, np.pad(np.stack(squares), ((0, 0), (0, 0), (0, 1))), material)

    return plain_scene(
        "chessboard", (mesh("white", white, 0), WHITE), (mesh("black", black, 1), BLACK)
    )
