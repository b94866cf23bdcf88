"""Least-squares fit of a camera together with the poses of a board.

It uses the Levenberg-Marquardt method on the normal equations. The Schur complement eliminates the
poses of the images, so that the time is proportional to the number of images, not to its cube.

Sources: Triggs et al., "Bundle adjustment: a modern synthesis" (2000); Marquardt 1963.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # its submodules load on first use

from omnisim.cameras import KannalaBrandtCamera
from omnisim.cameras.calibration.linear_fit import FITTED, ParameterVector
from omnisim.cameras.optics.system_calibration import move_jacobians, pose_from_directions
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.arrays import Floats, Ints
from omnisim.core.errors import MeasurementError, OpticsError
from omnisim.measurement.geometry.boards import BoardView

_STEP = 1e-6  # step of numerical derivatives: rad, or relative
_MAX_STEPS = 60
CONVERGED = 1e-9  # relative decrease of the cost
_MAX_DAMPING = 1e12


class Adjustment(NamedTuple):
    """Camera, poses and board shape with the smallest reprojection errors."""

    camera: ParametricCamera  # fitted camera
    poses: Floats  # (images, 4, 4) poses of the board in the camera's optical frame
    shape_m: Floats  # (corners, 3) offsets of the board's corners from their nominal positions
    errors_px: Floats  # (n, 2) measured minus predicted corners of all images, in order
    covariance: Floats  # (p, p) covariance of the camera's free parameters, for errors of 1 px

    @property
    def rms_px(self) -> float:
        """Root mean square of the corners' distances from their predictions."""
        return rms_px(self.errors_px)

    @property
    def unit_sigmas(self) -> Floats:
        """Sigmas (p,) of the free parameters for errors of 1 px; infinite: lost to rounding."""
        variances = np.diagonal(self.covariance)
        return np.sqrt(np.where(variances < 0.0, np.inf, variances))


def rms_px(errors_px: Floats) -> float:
    """Root mean square length of errors (n, 2)."""
    return float(np.sqrt(np.mean(np.square(errors_px).sum(axis=-1))))


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of a board in several images, in the order of the images."""

    nominal_m: Floats  # (corners, 3) nominal positions of the corners in the board's frame
    label: Ints  # (n,) index into `nominal_m`
    pixels_px: Floats  # (n, 2) positions in the image
    image: Ints  # (n,) index of the image, ascending
    starts: Ints  # (images + 1,) index of the first corner of each image, then n

    @classmethod
    def of(cls, views: Sequence[BoardView]) -> Corners:
        """Concatenate the corners of views."""
        points = np.concatenate([view.points_3d_m for view in views])
        nominal_m = np.unique(points, axis=0)
        label_of_point = {tuple(point): number for number, point in enumerate(nominal_m.tolist())}
        label = np.array([label_of_point[tuple(point)] for point in points.tolist()])
        pixels = np.concatenate([view.pixels_px for view in views])
        counts = [len(view.points_m) for view in views]
        image = np.repeat(np.arange(len(views)), counts)
        return cls(nominal_m, label, pixels, image, np.cumsum([0, *counts]))

    def arms_m(self, poses: Floats, shape_m: Floats) -> Floats:
        """Vectors (n, 3) from the board's origin to the corners, in the camera's axes.

        The board has the poses (images, 4, 4), and is bent by `shape_m` (corners, 3).
        """
        points = (self.nominal_m + shape_m)[self.label]
        return np.einsum("nij,nj->ni", poses[self.image, :3, :3], points)


class _State(NamedTuple):
    """Values of the unknowns, with the resulting camera, errors and cost."""

    vector: Floats  # (p,) free parameters of the camera
    shape_m: Floats  # (corners, 3)
    poses: Floats  # (images, 4, 4)
    camera: ParametricCamera
    errors_px: Floats  # (n, 2)
    cost: float


class _Blocks(NamedTuple):
    """Normal equations in the common parameters (c,) and in each image's pose."""

    common: Floats  # (c, c)
    mixed: Floats  # (images, c, 6)
    poses: Floats  # (images, 6, 6)
    common_side: Floats  # (c,)
    pose_side: Floats  # (images, 6)


class _Problem:
    """Reprojection errors, with a prior on the board's shape."""

    def __init__(
        self,
        parameters: ParameterVector[ParametricCamera],
        corners: Corners,
        stiffness_px_per_m: float | None,
    ) -> None:
        self.parameters, self.corners = parameters, corners
        self._stiffness = stiffness_px_per_m

    def state(self, vector: Floats, shape_m: Floats, poses: Floats) -> _State | None:
        """State at these unknowns; None: the camera is invalid or does not show all corners."""
        try:
            camera = self.parameters.camera(vector)
        except OpticsError:
            return None
        arms = self.corners.arms_m(poses, shape_m)
        seen = camera.pixel_from_ray(arms + poses[self.corners.image, :3, 3])
        if not (seen.valid.all() and np.isfinite(seen.positions_px).all()):
            return None
        errors = self.corners.pixels_px - seen.positions_px
        prior = 0.0 if self._stiffness is None else np.square(self._stiffness * shape_m).sum()
        cost = float(np.square(errors).sum() + prior)
        return _State(vector, shape_m, poses, camera, errors, cost)

    def blocks(self, state: _State) -> _Blocks:
        """Normal equations at a state."""
        corners = self.corners
        arms = corners.arms_m(state.poses, state.shape_m)
        points = arms + state.poses[corners.image, :3, 3]
        by_point = _point_jacobian(state.camera, points)
        by_pose = by_point @ move_jacobians(np.eye(4), np.zeros(6), arms)
        by_camera = _camera_jacobian(
            self.parameters, state.vector, points, corners.pixels_px - state.errors_px
        )
        by_shape = by_point @ state.poses[corners.image, :3, :3]
        cameras, images = len(state.vector), len(state.poses)
        count = cameras + (0 if self._stiffness is None else corners.nominal_m.size)
        starts = corners.starts[:-1]
        common, common_side = np.zeros((count, count)), np.zeros(count)
        mixed = np.zeros((images, count, 6))
        common[:cameras, :cameras] = _products(by_camera, by_camera).sum(axis=0)
        common_side[:cameras] = _sides(by_camera, state.errors_px).sum(axis=0)
        mixed[:, :cameras] = np.add.reduceat(_products(by_camera, by_pose), starts)
        if self._stiffness is not None:
            # an observation depends on the offset of one corner only: the matrix is sparse
            bends = cameras + 3 * corners.label[:, None] + np.arange(3)
            lens = np.arange(cameras)[:, None]
            np.add.at(common, (lens, bends[:, None]), _products(by_camera, by_shape))
            common[cameras:, :cameras] = common[:cameras, cameras:].T
            np.add.at(common, (bends[:, :, None], bends[:, None]), _products(by_shape, by_shape))
            np.add.at(mixed, (corners.image[:, None], bends), _products(by_shape, by_pose))
            np.add.at(common_side, bends, _sides(by_shape, state.errors_px))
            common[range(cameras, count), range(cameras, count)] += self._stiffness**2
            common_side[cameras:] -= self._stiffness**2 * state.shape_m.ravel()
        poses = np.add.reduceat(_products(by_pose, by_pose), starts)
        pose_side = np.add.reduceat(_sides(by_pose, state.errors_px), starts)
        return _Blocks(common, mixed, poses, common_side, pose_side)

    def moved(self, state: _State, step: Floats, moves: Floats) -> _State | None:
        """State after a step (c,) within the bounds, and moves (images, 6); None: invalid.

        Moves are rotation vectors, and translations.
        """
        parameters, count = self.parameters, len(state.vector)
        vector = np.clip(state.vector + step[:count], parameters.low, parameters.high)
        shape = state.shape_m
        if self._stiffness is not None:
            shape = shape + step[count:].reshape(-1, 3)
        poses = state.poses.copy()
        turns = scipy.spatial.transform.Rotation.from_rotvec(moves[:, :3]).as_matrix()
        poses[:, :3, :3] = turns @ state.poses[:, :3, :3]
        poses[:, :3, 3] += moves[:, 3:]
        return self.state(vector, shape, poses)


def adjust(
    parameters: ParameterVector[ParametricCamera],
    corners: Corners,
    poses: Floats,
    shape_m: Floats | None = None,
    stiffness_px_per_m: float | None = None,
    converged: float = CONVERGED,
) -> Adjustment:
    """Fit a camera's free parameters, if any, the board's poses, and optionally the board's shape.

    Starts from `poses` (images, 4, 4) and the offsets `shape_m` (corners, 3) of the board's corners
    (None: 0). The stiffness is the image error with the same cost as an offset of 1 m of a corner
    (None: the offsets are held); the fit ends when the cost decreases by a share less than
    `converged`.

    Raises:
        OpticsError: the initial camera does not show all corners.
    """
    problem = _Problem(parameters, corners, stiffness_px_per_m)
    shape = np.zeros_like(corners.nominal_m) if shape_m is None else shape_m
    state = problem.state(parameters.start, shape, poses)
    if state is None:
        raise OpticsError("it does not show all corners")
    damping, blocks = 1e-4, problem.blocks(state)
    for _ in range(_MAX_STEPS):
        trial = problem.moved(state, *_solve(blocks, damping))
        if trial is None or not trial.cost < state.cost:
            damping *= 8.0
            if damping > _MAX_DAMPING:
                break
            continue
        is_done = state.cost - trial.cost <= converged * state.cost
        state, damping = trial, max(damping / 8.0, 1e-12)
        blocks = problem.blocks(state)
        if is_done:
            break
    # covariance (p, p) of the camera's free parameters; 0 for parameters at a bound
    inside = (state.vector > parameters.low) & (state.vector < parameters.high)
    count = len(state.vector)
    used = np.concatenate((inside, np.ones(len(blocks.common) - count, dtype=bool)))
    weights = np.linalg.solve(blocks.poses, blocks.mixed[:, used].swapaxes(1, 2))
    reduced = blocks.common[np.ix_(used, used)]
    reduced = reduced - np.tensordot(blocks.mixed[:, used], weights, axes=((0, 2), (0, 1)))
    scale = _scale(reduced)
    inverse = np.linalg.pinv(reduced / np.outer(scale, scale), rcond=1e-14, hermitian=True)
    inverse /= np.outer(scale, scale)
    covariance = np.zeros((count, count))
    covariance[np.ix_(inside, inside)] = inverse[: inside.sum(), : inside.sum()]
    return Adjustment(state.camera, state.poses, state.shape_m, state.errors_px, covariance)


def _products(left: Floats, right: Floats) -> Floats:
    """Products (n, p, q) of the derivatives (n, 2, p) and (n, 2, q) of n corners."""
    first, second = (left[:, axis, :, None] * right[:, axis, None, :] for axis in (0, 1))
    return first + second


def _sides(jacobian: Floats, errors_px: Floats) -> Floats:
    """Products (n, p) of the derivatives (n, 2, p) and the errors (n, 2) of n corners."""
    return (errors_px[:, :, None] * jacobian).sum(axis=1)


def _camera_jacobian(
    parameters: ParameterVector[ParametricCamera], vector: Floats, points: Floats, pixels_px: Floats
) -> Floats:
    """Derivatives (n, 2, p) of the corners' pixels (n, 2) by the camera's free parameters."""
    jacobian = np.zeros((len(points), 2, len(vector)))
    for index, value in enumerate(vector):
        for sign in (1.0, -1.0):  # backward if the forward step leaves the domain
            step = sign * _STEP * max(1.0, abs(float(value)))
            moved = vector.copy()
            moved[index] += step
            if not parameters.low[index] <= moved[index] <= parameters.high[index]:
                continue
            seen = parameters.camera(moved).pixel_from_ray(points)
            if seen.valid.all():
                jacobian[:, :, index] = (seen.positions_px - pixels_px) / step
                break
    return jacobian


def _point_jacobian(camera: ParametricCamera, points: Floats) -> Floats:
    """Derivatives (n, 2, 3) of the pixels of points (n, 3) by the points."""
    distances = np.linalg.norm(points, axis=1, keepdims=True)
    directions = points / distances
    helper = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    first = np.cross(directions, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    tangents = np.stack((first, np.cross(directions, first)))
    steps = _STEP * np.stack((tangents, -tangents))
    seen = camera.pixel_from_ray(directions + steps)
    plus, minus = np.where(seen.valid[..., None], seen.positions_px, np.nan)
    rates = np.nan_to_num((plus - minus) / (2.0 * _STEP))
    return np.einsum("tnp,tnc->npc", rates, tangents / distances)


def _solve(blocks: _Blocks, damping: float) -> tuple[Floats, Floats]:
    """Step (c,) of the common parameters and moves (images, 6) of the poses."""
    poses = blocks.poses + damping * _diagonal(blocks.poses)
    common = blocks.common + damping * _diagonal(blocks.common)
    weights = np.linalg.solve(poses, blocks.mixed.swapaxes(1, 2))  # (images, 6, c)
    reduced = common - np.tensordot(blocks.mixed, weights, axes=((0, 2), (0, 1)))
    side = blocks.common_side - np.einsum("bic,bi->c", weights, blocks.pose_side)
    scale = _scale(reduced)
    scaled = reduced / np.outer(scale, scale)
    step = side
    if len(side):
        try:
            factor = scipy.linalg.cho_factor(scaled, check_finite=False)
            step = scipy.linalg.cho_solve(factor, side / scale, check_finite=False) / scale
        except scipy.linalg.LinAlgError:  # singular: the shortest solution
            step = np.linalg.lstsq(scaled, side / scale, rcond=1e-14)[0] / scale
    rest = blocks.pose_side - np.einsum("bci,c->bi", blocks.mixed, step)
    return step, np.linalg.solve(poses, rest[..., None])[..., 0]


def _scale(matrix: Floats) -> Floats:
    """Scales (n,) that make the diagonal of a matrix (n, n) 1."""
    diagonal = np.diagonal(matrix)
    return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def _diagonal(matrices: Floats) -> Floats:
    """Matrices (..., n, n) with all elements off the diagonal set to 0."""
    return np.eye(matrices.shape[-1]) * matrices


# Initial camera and poses from corners alone: an equidistant lens, then Kannala and Brandt's.


_WIDEST_RAD = np.geomspace(0.15, 3.0, 32)  # angles of the farthest corner that are tried
_MAX_BOARDS = 20  # used to choose among them


def initial_adjustment(views: Sequence[BoardView], size_px: tuple[int, int]) -> Adjustment:
    """Lens of Kannala and Brandt that fits the corners in images of a size, with the boards' poses.

    Raises:
        MeasurementError: no lens fits the corners.
    """
    center = 0.5 * (size_px[0] - 1.0), 0.5 * (size_px[1] - 1.0)
    radius = max(np.linalg.norm(view.pixels_px - center, axis=1).max() for view in views)
    some = views[:: math.ceil(len(views) / _MAX_BOARDS)]
    candidates = []
    for widest in _WIDEST_RAD:
        focal = float(radius / widest)
        lens = KannalaBrandtCamera(*size_px, (focal, focal), center, (0.0,) * 4)
        residuals = []  # angular errors of each board, times the focal length
        for view in some:
            directions = _directions(lens, view)
            pose = pose_from_directions(directions, view.points_m)
            predicted = view.points_3d_m @ pose[:3, :3].T + pose[:3, 3]
            predicted /= np.linalg.norm(predicted, axis=1, keepdims=True)
            errors = np.linalg.norm(predicted - directions, axis=1)
            residuals.append(focal * float(np.sqrt(np.mean(errors**2))))
        candidates.append((float(np.median(residuals)), lens))
    first = min(candidates, key=lambda candidate: candidate[0])[1]
    poses = np.stack(
        [pose_from_directions(_directions(first, view), view.points_m) for view in views]
    )
    camera: ParametricCamera = first
    corners = Corners.of(views)
    free = FITTED[KannalaBrandtCamera].free
    stages: tuple[list[str], ...] = (
        [f"coefficients.{index}" for index in range(4)]
        + ["principal_point_px.0", "principal_point_px.1"],
        ["coefficients.2", "coefficients.3"],
        [],
    )
    for fixed in stages:
        parameters: ParameterVector[ParametricCamera] = ParameterVector(camera, free, fixed)
        try:
            fitted = adjust(parameters, corners, poses)
        except OpticsError as reason:
            raise MeasurementError(f"no lens fits the corners: {reason}") from None
        camera, poses = fitted.camera, fitted.poses
    return fitted


def _directions(camera: KannalaBrandtCamera, view: BoardView) -> Floats:
    """Directions (n, 3) of a view's corners through an equidistant lens, optical frame."""
    offsets = (view.pixels_px - camera.principal_point_px) / camera.focal_lengths_px
    theta = np.linalg.norm(offsets, axis=1, keepdims=True)
    across = offsets * np.sinc(theta / math.pi)
    return np.concatenate((across, np.cos(theta)), axis=1)
