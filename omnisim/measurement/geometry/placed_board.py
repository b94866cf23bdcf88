"""Board of an image, placed in the camera's frame: its pose, its shape and its pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
import scipy  # its submodules load on first use

from omnisim.cameras import NonCentralCamera
from omnisim.cameras.calibration.linear_fit import ParameterVector
from omnisim.cameras.camera import CentralCamera, Pixels
from omnisim.cameras.optics.system_calibration import pose_from_directions
from omnisim.core.arrays import Floats
from omnisim.core.errors import MeasurementError, OpticsError
from omnisim.measurement.geometry.boards import BoardView
from omnisim.measurement.geometry.bundle_adjustment import Corners, adjust

if TYPE_CHECKING:
    from omnisim.cameras.parametric_camera import ParametricCamera

_MIN_CURVED = 6  # corners that determine a curved board


@dataclass(frozen=True, eq=False)
class BoardSurface:
    """Surface of a board that is not quite flat.

    Between and beyond its corners the offsets from the plane are interpolated by a thin plate.

    Source: Duchon, "Splines minimizing rotation-invariant semi-norms" (1977).
    """

    nominal_m: Floats  # (corners, 2) corners on the flat board
    offsets_m: Floats  # (corners, 3) offsets of the real corners

    @classmethod
    def flat(cls) -> BoardSurface:
        """Flat board, exactly printed."""
        return cls(np.zeros((0, 2)), np.zeros((0, 3)))

    @classmethod
    def measured(cls, corners_m: Floats, points_m: Floats) -> BoardSurface:
        """Surface through measured corners (corners, 3), by the nominal ones (n, 2).

        Measured corners without a nominal one within a quarter of the spacing are ignored.
        """
        tree = scipy.spatial.KDTree(points_m)
        spacing_m = float(np.asarray(tree.query(points_m, k=2)[0])[:, 1].min())
        distances, nearest = map(np.asarray, tree.query(corners_m[:, :2]))
        is_near = distances < 0.25 * spacing_m
        nominal = points_m[nearest[is_near]]
        if len(np.unique(nominal, axis=0)) < max(len(nominal), _MIN_CURVED):
            return cls.flat()
        return cls(nominal, corners_m[is_near] - np.pad(nominal, ((0, 0), (0, 1))))

    def points(self, positions_m: Floats) -> Floats:
        """Points (..., 3) of positions (..., 2) on the flat board."""
        flat = np.concatenate((positions_m, np.zeros((*positions_m.shape[:-1], 1))), axis=-1)
        if not self.offsets_m.any():
            return flat
        plate = scipy.interpolate.RBFInterpolator(self.nominal_m, self.offsets_m)
        return flat + plate(positions_m.reshape(-1, 2)).reshape(flat.shape)


@dataclass(frozen=True, eq=False)
class PlacedBoard:
    """Board of a shape in the pose (4, 4) optical_from_board that it has in a camera's image."""

    camera: CentralCamera
    surface: BoardSurface
    pose: Floats

    def pixels(self, positions_m: Floats) -> Pixels:
        """Pixels of positions (..., 2) on the flat board."""
        points = self.surface.points(positions_m) @ self.pose[:3, :3].T + self.pose[:3, 3]
        return pixels_of_points(self.camera, points)


def pixels_of_points(camera: CentralCamera, points_m: Floats) -> Pixels:
    """Pixels of points (..., 3) in a camera's optical frame."""
    if isinstance(camera, NonCentralCamera):
        return camera.pixel_from_point(points_m)
    return camera.pixel_from_ray(points_m)


def locate_board(
    camera: CentralCamera, view: BoardView, surface: BoardSurface | None = None
) -> PlacedBoard:
    """Fit the pose of a board in a camera's image; surface None: flat, as always if non-central.

    Raises:
        MeasurementError: the camera does not show the corners.
    """
    surface = BoardSurface.flat() if surface is None else surface
    rays = camera.ray_from_pixel(view.pixels_px)
    if not rays.valid.all():
        message = f"{view.name}: the camera shows {rays.valid.sum()} of {len(rays.valid)} corners"
        raise MeasurementError(message)
    try:
        if isinstance(camera, NonCentralCamera):
            from omnisim.cameras.optics.system_calibration import BoardCorners, calibrate_system

            table = {key: value for key, value in camera.parameters().items() if key != "model"}
            boards = [BoardCorners(view.points_m, view.pixels_px)]
            pose = calibrate_system(table, (), boards).poses[0]
            return PlacedBoard(camera, BoardSurface.flat(), pose)
        corners = Corners.of([view])
        pose = pose_from_directions(rays.directions, view.points_m)
        shape_m = surface.points(corners.nominal_m[:, :2]) - corners.nominal_m
        fixed = ParameterVector(cast("ParametricCamera", camera), {})  # nothing of it is free
        return PlacedBoard(camera, surface, adjust(fixed, corners, pose[None], shape_m).poses[0])
    except OpticsError as reason:
        raise MeasurementError(f"{view.name}: {reason}") from None
