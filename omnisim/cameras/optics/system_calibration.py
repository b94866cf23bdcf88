"""Calibration of an optical system's parameters from board corners in images.

It minimizes squared reprojection errors with the exact inverse and exact derivatives: a pixel moves
with its point (`pixel_jacobians`), and against the motion of its own ray at that point.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # its submodules load on first use

from omnisim.cameras.optics.centrality import CentralView, pixel_jacobians
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.trajectories.formats.parsed_trajectory import read_columns

_STEP = 1e-6  # step of derivatives, relative to a parameter, or absolute below 1
_SINGULAR = 1e-7  # smallest singular value of the scaled Jacobian, as a share of the largest
_UNSEEN_PX = 1e-4  # minimum motion of corners if a parameter grows by 1 or doubles
_SHARE = 0.1  # component of an undetermined direction above which a parameter is part of it
_MAX_STEPS = 100
_WIDER = 1.1  # widens rims, so that a step that moves a rim hides no corner


@dataclass(frozen=True, eq=False)
class FittedParameter:
    """A system parameter fitted to the corners."""

    name: str  # key of the parameter
    # before, value: value in the file, and fitted value
    before: float
    value: float
    sigma: float  # standard deviation, for independent errors as large as the residuals


@dataclass(frozen=True, eq=False)
class SystemCalibration:
    """An optical system fitted to corners."""

    system: OpticalSystem  # fitted system
    table: dict[str, Any]  # table of its optics file
    parameters: tuple[FittedParameter, ...]  # fitted parameters
    poses: Floats  # (boards, 4, 4) poses of the boards in the sensor's optical frame
    # before_px, errors_px: (n, 2) reprojection errors of all corners after fitting only the poses,
    # and after fitting the parameters too
    before_px: Floats
    errors_px: Floats


def calibrate_system(
    table: Mapping[str, Any],
    free: Sequence[str],
    boards: Sequence[BoardCorners],
    source: str = "optics",
    poses: Floats | None = None,
) -> SystemCalibration:
    """Fit parameters of an optical system, together with the poses of the boards.

    Args:
        table: table of the optics file, close to the true values.
        free: keys of the free parameters, see `FreeParameters`; empty: fit only the poses.
        boards: corners in the images.
        source: file name, for messages.
        poses: (boards, 4, 4) initial poses of the boards in the sensor's optical frame; None: as if
            all rays met in one point.

    Raises:
        OpticsError: there is no board, the system does not see the corners, or the corners do not
            determine the parameters.
    """
    if not boards:
        raise OpticsError("corners: expected a board, got none")
    fixed, parameters = (FreeParameters(table, keys, source) for keys in ((), free))
    system = fixed.system(fixed.values)
    if poses is None:
        viewpoint_m = CentralView(system).viewpoint_m
        poses = np.stack([first_pose(system, viewpoint_m, board) for board in boards])
    rough = _Problem(fixed, boards, poses).solve()
    if not parameters.names:
        return rough
    fitted = _Problem(parameters, boards, rough.poses).solve()
    return dataclasses.replace(fitted, before_px=rough.errors_px)


class _Problem:
    """Least-squares problem in the free parameters and a move of each board's pose."""

    def __init__(self, parameters: FreeParameters, boards: Sequence[BoardCorners], poses: Floats):
        self._parameters, self._boards, self._poses = parameters, boards, poses
        self._pixels = np.concatenate([board.pixels_px for board in boards])
        self._count = len(parameters.names)
        self._values = parameters.values
        self._system = self._open_system(parameters.values)
        self._vector, self._predicted, self._errors = np.zeros(0), self._pixels, np.zeros(0)

    def solve(self) -> SystemCalibration:
        """Minimize the errors."""
        parameters = self._parameters
        start = np.concatenate((parameters.values, np.zeros(6 * len(self._boards))))
        solution = scipy.optimize.least_squares(
            self.errors, start, self.jacobian, method="lm", x_scale="jac",
            ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=_MAX_STEPS,
        )  # fmt: skip
        values, moves = self._split(solution.x)
        sigmas = self._sigmas(self.jacobian(solution.x), solution.fun)
        rows = zip(parameters.names, parameters.values, values, sigmas, strict=True)
        fitted = tuple(FittedParameter(name, *map(float, numbers)) for name, *numbers in rows)
        system, table = parameters.system(values), parameters.table(values)
        errors_px = solution.fun.reshape(-1, 2)
        return SystemCalibration(system, table, fitted, self._moved(moves), errors_px, errors_px)

    def errors(self, vector: Floats) -> Floats:
        """Reprojection errors (2 n,) of all corners in pixels."""
        if np.array_equal(vector, self._vector):  # already computed, for example for the Jacobian
            return self._errors
        values, moves = self._split(vector)
        try:
            if not np.array_equal(values, self._values):
                self._values, self._system = values, self._open_system(values)
            seen = self._system.pixel_from_point(np.concatenate(self._points(moves)))
        except OmnisimError:
            return np.full(self._pixels.size, self._lost_px)  # the solver takes back such a step
        valid = seen.valid[:, None]
        self._vector = vector.copy()
        self._predicted = np.where(valid, seen.positions_px, self._pixels)
        errors = np.where(valid, seen.positions_px - self._pixels, self._lost_px)
        self._errors = errors.ravel()
        return self._errors

    def jacobian(self, vector: Floats) -> Floats:
        """Derivatives (2 n, parameters + 6 boards) of the errors; 0 for unseen corners."""
        values, moves = self._split(vector)
        self.errors(vector)  # updates the predictions
        pixels, points = self._predicted, self._points(moves)
        points_m = np.concatenate(points)
        by_point = np.nan_to_num(pixel_jacobians(self._system, pixels, points_m))
        columns = np.zeros((len(pixels), 2, len(vector)))
        lengths = np.linalg.norm(points_m - self._system.rays(pixels).origins_m, axis=1)[:, None]
        for index in range(self._count):
            step = _STEP * max(1.0, abs(float(values[index]))) * np.eye(self._count)[index]
            ends = []
            for sign in (1.0, -1.0):
                rays = self._open_system(values + sign * step).rays(pixels)
                ends.append(rays.origins_m + lengths * rays.directions)
            drift = (ends[0] - ends[1]) / (2.0 * step[index])
            columns[:, :, index] = -np.einsum("nij,nj->ni", by_point, drift)
        first = 0
        for number, board in enumerate(self._boards):
            rows = slice(first, first + len(board.points_m))
            at = self._count + 6 * number
            by_move = move_jacobians(self._poses[number], moves[number], board.points_3d_m)
            columns[rows, :, at : at + 6] = by_point[rows] @ by_move
            first = rows.stop
        return columns.reshape(self._pixels.size, -1)

    def _open_system(self, values: Floats) -> OpticalSystem:
        """System that hides no corner seen before: with wider rims and without obstacles."""
        system = self._parameters.system(values)
        surfaces = tuple(
            dataclasses.replace(surface, rim_radius_m=_WIDER * surface.rim_radius_m)
            for surface in system.surfaces
        )
        return dataclasses.replace(system, surfaces=surfaces, obstacles=())

    @property
    def _lost_px(self) -> float:
        return float(self._system.width_px + self._system.height_px)

    def _split(self, vector: Floats) -> tuple[Floats, Floats]:
        """Parameters, and moves (boards, 6)."""
        return vector[: self._count], vector[self._count :].reshape(-1, 6)

    def _moved(self, moves: Floats) -> Floats:
        pairs = zip(self._poses, moves, strict=True)
        return np.stack([moved_pose(pose, move) for pose, move in pairs])

    def _points(self, moves: Floats) -> list[Floats]:
        """Corners (n, 3) of each board in the sensor's optical frame."""
        poses = self._moved(moves)
        return [
            board.points_3d_m @ pose[:3, :3].T + pose[:3, 3]
            for board, pose in zip(self._boards, poses, strict=True)
        ]

    def _sigmas(self, jacobian: Floats, errors: Floats) -> Floats:
        """Standard deviations (parameters,) of the parameters."""
        if self._count == 0:
            return np.zeros(0)
        scale = np.linalg.norm(jacobian, axis=0)
        effects_px = scale[: self._count] * np.maximum(1.0, np.abs(self._values))
        self._check(effects_px < _UNSEEN_PX)
        _, sizes, directions = np.linalg.svd(jacobian / scale, full_matrices=False)
        if sizes[-1] < _SINGULAR * sizes[0]:
            parts = np.abs(directions[-1, : self._count])
            self._check(parts > _SHARE * parts.max())
        freedom = max(len(errors) - len(sizes), 1)
        variances = np.square(directions / sizes[:, None]).sum(axis=0) * (errors @ errors) / freedom
        return (np.sqrt(variances) / scale)[: self._count]

    def _check(self, undetermined: Bools) -> None:
        """Reject parameters (n,) that the corners do not determine."""
        if undetermined.any():
            names = [
                self._parameters.names[index] for index in np.flatnonzero(undetermined).tolist()
            ]
            message = "not determined by the corners: expected fewer free parameters"
            raise OpticsError(f"{', '.join(names)}: {message}")


# Numbers in an optics file that a calibration may change, addressed by their keys.


_ZEROS = ("decenter_m", "tilt_deg")  # 0 if left out
_Path = tuple[str | int, ...]


class FreeParameters:
    """Numbers in an optics file's table, addressed by keys; `source` names it in messages.

    A key names a number, or a list to select all its numbers: `camera.focal_length_px`,
    `surfaces.0.decenter_m`, `surfaces.0.tilt_deg.2`.

    Attributes:
        names: keys of the numbers, in the order of `values`.
        values: (n,) values in the table.

    Raises:
        OpticsError: a key names no number, or a number is named twice.
    """

    def __init__(self, table: Mapping[str, Any], keys: Sequence[str], source: str):
        self._source, self._paths = source, list[_Path]()
        self._table: dict[str, Any] = copy.deepcopy(dict(table))
        for key in keys:
            for path in self._find(key):
                if path in self._paths:
                    raise OpticsError(f"{source}: {key}: expected each number once, got it twice")
                self._paths.append(path)
        self.names = [".".join(map(str, path)) for path in self._paths]
        values = [_at(self._table, path) for path in self._paths]
        self.values: Floats = np.array(values, dtype=np.float64)

    def table(self, values: Floats) -> dict[str, Any]:
        """The file's table with other values (n,)."""
        changed = copy.deepcopy(self._table)
        for path, value in zip(self._paths, values.tolist(), strict=True):
            _at(changed, path[:-1])[path[-1]] = value
        return changed

    def system(self, values: Floats) -> OpticalSystem:
        """Build the optical system with other values (n,).

        Raises:
            SensorFileError: a value is invalid for the system.
        """
        return parse_optics(self.table(values), self._source)

    def _find(self, key: str) -> list[_Path]:
        """Paths to the numbers of a key; optional keys that are missing are added to the table."""
        path: _Path = tuple(int(part) if part.isdecimal() else part for part in key.split("."))
        for end in (len(path) - 1, len(path) - 2):
            holder = _at(self._table, path[:end]) if end > 0 else None
            if isinstance(holder, dict) and path[end] in _ZEROS and "pose" not in holder:
                holder.setdefault(path[end], [0.0, 0.0, 0.0])
        value = _at(self._table, path)
        if isinstance(value, list) and value and all(map(_is_number, value)):
            return [(*path, index) for index in range(len(value))]
        if not _is_number(value):
            actual = "no such key" if value is None else f"{value!r:.60}"
            raise OpticsError(f"{self._source}: {key}: expected a number, got {actual}")
        return [path]


def _at(table: Any, path: _Path) -> Any:
    """Value at a path in tables and lists, or None."""
    for part in path:
        if isinstance(table, dict):
            table = table.get(part)
        elif isinstance(table, list) and isinstance(part, int) and part < len(table):
            table = table[part]
        else:
            return None
    return table


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


# Corners of calibration boards in images, and the boards' poses.


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
    columns = read_columns(path, COLUMNS, OpticsError)
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
    """Pose (4, 4) of a board, sensor's optical frame, as if all rays met in a viewpoint (3,).

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
    """Pose (4, 4) of a flat board, from unit directions (n, 3) of its corners (n, 2), n at least 4.

    Source: the homography of a plane by direct linear transformation, Hartley and Zisserman 2004,
    with unit directions instead of image coordinates.
    """
    plane = np.column_stack((points_m, np.ones(len(points_m))))
    # d × (H p) = 0
    crosses = np.cross(np.eye(3), directions[:, None, :]).transpose(0, 2, 1)
    rows = np.einsum("nij,nk->nijk", crosses, plane).reshape(-1, 9)
    homography = np.linalg.svd(rows, full_matrices=False)[2][-1].reshape(3, 3)
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
