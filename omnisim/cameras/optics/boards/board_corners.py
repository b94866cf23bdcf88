"""Corners of calibration boards in images, and the boards' poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy  # its submodules load on first use

from omnisim.cameras.optics.system import OpticalSystem
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError, TrajectoryError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.trajectories.formats.parsed_trajectory import read_text_table

COLUMNS = ("image", "x_m", "y_m", "u_px", "v_px")
MIN_CORNERS = 6  # per board, to determine its pose


@dataclass(frozen=True, eq=False)
class BoardCorners:
    """Board corners in one image.

    Raises:
        OpticsError: there are too few corners, or the shapes are wrong.
    """

    points_m: Floats  # (n, 2) positions on the flat board
    pixels_px: Floats  # (n, 2) positions in the image

    def __post_init__(self) -> None:
        shapes = np.shape(self.points_m), np.shape(self.pixels_px)
        if shapes[0] != shapes[1] or shapes[0][1:] != (2,):
            raise OpticsError(f"corners: expected points and pixels (n, 2), got {shapes}")
        if len(self.points_m) < MIN_CORNERS:
            expected = f"expected at least {MIN_CORNERS} corners of a board"
            raise OpticsError(f"corners: {expected}, got {len(self.points_m)}")

    @property
    def points_3d_m(self) -> Floats:
        """Corners (n, 3) in the board's frame, z = 0."""
        return np.column_stack((self.points_m, np.zeros(len(self.points_m))))


def read_corners(path: Path) -> list[BoardCorners]:
    """Read the corners of each image from a file.

    Raises:
        OpticsError: the file is invalid; names file, line, actual and expected value.
    """
    try:
        table = read_text_table(path)
        names = table.lines[0].cells
        if sorted(names) != sorted(COLUMNS):
            message = f"expected the columns {','.join(COLUMNS)}, got {','.join(names)}"
            raise OpticsError(f"{path}: {message}")
        numbers = table.without_header().numbers(names)
    except TrajectoryError as reason:
        raise OpticsError(str(reason)) from None
    columns = numbers[:, [names.index(name) for name in COLUMNS]]
    boards = []
    for image in np.unique(columns[:, 0]):
        rows = columns[columns[:, 0] == image]
        try:
            boards.append(BoardCorners(rows[:, 1:3], rows[:, 3:5]))
        except OpticsError as reason:
            raise OpticsError(f"{path}: image {image:g}: {reason}") from None
    return boards


def write_corners(path: Path, boards: Sequence[BoardCorners]) -> None:
    """Write corners to a CSV file.

    Raises:
        OutputError: the file cannot be written.
    """
    lines = [",".join(COLUMNS)]
    for number, board in enumerate(boards):
        rows = np.column_stack((board.points_m, board.pixels_px)).tolist()
        lines += [f"{number},{','.join(map(repr, row))}" for row in rows]
    write_text(path, "\n".join(lines) + "\n")


# Pose of a board from the rays of its corners: an initial pose, and its derivatives.


def first_pose(system: OpticalSystem, viewpoint_m: Floats, board: BoardCorners) -> Floats:
    """Pose (4, 4) of a board in the sensor's optical frame, as if all rays met in one point.

    Args:
        system: optical system.
        viewpoint_m: (3,) point nearest to all rays, in the sensor's optical frame.
        board: corners in the image.

    Raises:
        OpticsError: the system sees too few of the corners.
    """
    rays = system.rays(board.pixels_px)
    if rays.valid.sum() < MIN_CORNERS:
        message = f"expected at least {MIN_CORNERS} corners where the optics see anything"
        raise OpticsError(f"corners: {message}, got {rays.valid.sum()}")
    pose = pose_from_directions(rays.directions[rays.valid], board.points_m[rays.valid])
    pose[:3, 3] += viewpoint_m
    return pose


def pose_from_directions(directions: Floats, points_m: Floats) -> Floats:
    """Pose (4, 4) of a flat board, from the directions of its corners in the camera's frame.

    Source: the homography of a plane by direct linear transformation, Hartley and Zisserman 2004,
    with unit directions instead of image coordinates.

    Args:
        directions: (n, 3) unit directions from the viewpoint, n at least 4.
        points_m: (n, 2) corners on the board.
    """
    plane = np.column_stack((points_m, np.ones(len(points_m))))
    # d × (H p) = 0
    crosses = np.cross(np.eye(3), directions[:, None, :]).transpose(0, 2, 1)
    rows = np.einsum("nij,nk->nijk", crosses, plane).reshape(-1, 9)
    homography = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    if np.einsum("nj,jk,nk->", directions, homography, plane) < 0.0:
        homography = -homography
    homography /= 0.5 * np.linalg.norm(homography[:, :2], axis=0).sum()
    first, second, middle_m = homography.T
    u, _, v = np.linalg.svd(np.stack((first, second, np.cross(first, second)), axis=1))
    pose = np.eye(4)
    pose[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    pose[:3, 3] = middle_m
    return pose


def moved_pose(pose: Floats, move: Floats) -> Floats:
    """Pose (4, 4) after a move (6,): a rotation vector about its origin, and a translation."""
    moved = pose.copy()
    moved[:3, :3] = scipy.spatial.transform.Rotation.from_rotvec(move[:3]).as_matrix()
    moved[:3, :3] @= pose[:3, :3]
    moved[:3, 3] += move[3:]
    return moved


def move_jacobians(pose: Floats, move: Floats, points_m: Floats) -> Floats:
    """Derivatives (n, 3, 6) of the points (n, 3) of a moved board with respect to the move.

    Source: the left Jacobian of SO(3), Barfoot, State Estimation for Robotics (2017), 7.77.
    """
    arms = points_m @ moved_pose(pose, move)[:3, :3].T
    angle, cross = float(np.linalg.norm(move[:3])), _cross_matrices(move[:3])
    left = np.eye(3) + 0.5 * cross + cross @ cross / 6.0
    if angle > 1e-4:
        left = np.eye(3) + (1.0 - np.cos(angle)) / angle**2 * cross
        left += (angle - np.sin(angle)) / angle**3 * (cross @ cross)
    turned = -_cross_matrices(arms) @ left
    return np.concatenate((turned, np.broadcast_to(np.eye(3), turned.shape)), axis=2)


def _cross_matrices(vectors: Floats) -> Floats:
    """Matrices (..., 3, 3) whose product with a vector is the cross product."""
    return np.cross(np.eye(3), vectors[..., None, :])
