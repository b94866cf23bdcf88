"""Free parameters of a camera as a vector, for solvers."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import FThetaInverseCamera
from omnisim.cameras.calibration.linear_fit import Bounds
from omnisim.cameras.parametric_camera import ParametricCamera

CameraT = TypeVar("CameraT", bound=ParametricCamera)


class ParameterVector(Generic[CameraT]):
    """Numbers of a camera that a solver may change, each in units of similar effect.

    Args:
        camera: initial camera.
        free: bounds of the free attributes, by name.
        fixed: labels of numbers that are held constant, such as `affine.2`.

    Attributes:
        labels: attribute, or attribute and index, of each number.
        start: (n,) numbers of the initial camera.
        low, high: (n,) bounds.
        units: (n,) attribute's value per number of the vector.
    """

    def __init__(
        self, camera: CameraT, free: Mapping[str, Bounds], fixed: Collection[str] = ()
    ) -> None:
        self._camera, self._names = camera, list(free)
        values = [np.atleast_1d(getattr(camera, name)).astype(np.float64) for name in free]
        self._lengths = [len(value) for value in values]
        labels = [
            f"{name}.{index}" if isinstance(getattr(camera, name), tuple) else name
            for name, length in zip(free, self._lengths, strict=True)
            for index in range(length)
        ]
        units = [_units(name, value, camera) for name, value in zip(free, values, strict=True)]
        self._all = np.concatenate([np.zeros(0), *values])
        self._units = np.concatenate([np.zeros(0), *units])
        bounds = np.repeat(np.reshape(list(free.values()), (-1, 2)), self._lengths, axis=0)
        low, high = bounds.T
        self._used = np.array([label not in fixed for label in labels], dtype=bool)
        self.labels = [label for label, used in zip(labels, self._used, strict=True) if used]
        self.units = self._units[self._used]
        self.start = (self._all / self._units)[self._used]
        self.low, self.high = (low / self._units)[self._used], (high / self._units)[self._used]

    def camera(self, vector: NDArray[np.float64]) -> CameraT:
        """Camera with other numbers (n,).

        Raises:
            OpticsError: the numbers do not make a valid camera.
        """
        if not self._names:
            return self._camera
        values = self._all.copy()
        values[self._used] = vector * self.units
        parts = np.split(values, np.cumsum(self._lengths)[:-1])
        changes: dict[str, Any] = {
            name: tuple(part.tolist())
            if isinstance(getattr(self._camera, name), tuple)
            else float(part[0])
            for name, part in zip(self._names, parts, strict=True)
        }
        return dataclasses.replace(self._camera, **changes)


def _units(name: str, values: NDArray[np.float64], camera: ParametricCamera) -> NDArray[np.float64]:
    """Step units (n,) of a parameter's values that move the image by similar distances.

    The units of a polynomial of the image radius are powers of the radius.
    """
    powers = np.arange(len(values), dtype=np.float64)
    if name == "coefficients" and isinstance(camera, FThetaInverseCamera):
        powers += 1.0  # without a constant term
    elif name != "polynomial":
        return np.ones(len(values))
    radius_px = 0.5 * max(camera.width_px, camera.height_px)
    return radius_px**-powers
