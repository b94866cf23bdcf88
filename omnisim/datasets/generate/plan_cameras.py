"""Cameras of a plan: read from their files, and varied for each setup."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.core.errors import OmnisimError, PlanError, did_you_mean
from omnisim.core.files.sources import recorded_sources
from omnisim.core.poses import pose
from omnisim.datasets.generate.distributions import Distribution, Shares
from omnisim.datasets.generate.plan import PlanCameraTable
from omnisim.rendering.camera.captured_image import camera_of_parameters
from omnisim.rendering.camera.degradations import Degradation, Exposure, preset
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS, parse_degradation
from omnisim.rendering.camera.omnicamera import OmniCamera

WHOLE_RIG = "all"
ROUNDING = 1e-9  # of a parameter that is computed from others


@dataclass(frozen=True, eq=False)
class PlanRig:
    """Cameras of a plan that take samples together."""

    title: str  # name in the data set
    cameras: dict[str, OmniCamera]  # cameras by name; a single camera's name is empty

    @property
    def first(self) -> OmniCamera:
        """Camera at the drawn viewpoint."""
        return next(iter(self.cameras.values()))


class RigFile:
    """Cameras of one [[cameras]] table of a plan; their file is read once.

    Args:
        table: table of the plan.
        plan: path of the plan's file.
        is_exposed: True: the exposure varies between images.

    Attributes:
        sources: the files that were read.

    Raises:
        OmnisimError: a faulty file.
    """

    def __init__(self, table: PlanCameraTable, plan: Path, is_exposed: bool):
        self.table, self._plan, self._is_exposed = table, plan, is_exposed
        with recorded_sources() as self.sources:
            self._read = _read_cameras(table, plan.parent)
            if table.preset is not None:
                preset(table.preset, plan.parent)

    def rig(self, stream: Shares | None = None) -> PlanRig:
        """Rig with its size, quality and degradations.

        Args:
            stream: stream for varying values; None: nothing varies.

        Raises:
            OmnisimError: invalid parameters of the camera.
        """
        table, cameras = self.table, {}
        for name, camera in self._read.items():
            if stream is not None:
                camera = self._drawn(camera, stream)
            if table.size_px is not None:
                camera = camera.resized(table.size_px)
            if table.quality is not None:
                camera = camera.with_quality(table.quality)
            if table.preset is not None:
                camera = camera.with_degradation(preset(table.preset, self._plan.parent))
            if stream is not None and table.degradation:
                camera = camera.with_degradation(self._degradation(camera.degradation, stream))
            cameras[name] = self._exposed(camera) if self._is_exposed else camera
        return PlanRig(table.title, cameras)

    def _place(self, key: str) -> str:
        return f"{self._plan}: cameras: {self.table.title}: {key}"

    def _drawn(self, camera: OmniCamera, stream: Shares) -> OmniCamera:
        """Camera with drawn parameters and a drawn mount."""
        table = self.table
        model = self._varied(camera.model, table.parameters, stream)
        shift_m = [table.mount_shift_m.draw(stream) for _ in range(3)]
        roll_deg, pitch_deg, yaw_deg = (table.mount_turn_deg.draw(stream) for _ in range(3))
        turn = pose(shift_m, roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)
        mount = camera.base_from_rig @ turn
        return dataclasses.replace(camera, model=model, base_from_rig=mount)

    def _varied(
        self, model: CentralCamera, parameters: Mapping[str, Distribution], stream: Shares
    ) -> CentralCamera:
        """Camera model with drawn offsets added to its parameters."""
        if not parameters:
            return model
        wanted: dict[str, Any] = dict(model.parameters())
        known = {key: _numbers(value) for key, value in wanted.items()}
        for key, distribution in parameters.items():
            if not (numbers := known.get(key, [])):
                existing = [key for key, numbers in known.items() if numbers]
                raise PlanError(
                    f"{self._place(f'parameters.{key}')}: of model {model.model_name!r}: "
                    f"{did_you_mean(key, existing, 'expected one of')}"
                )
            known[key] = [one + distribution.draw(stream) for one in numbers]
            wanted[key] = known[key] if isinstance(wanted[key], list) else known[key][0]
        try:
            camera = camera_of_parameters(wanted)
        except OmnisimError as reason:
            raise PlanError(f"{self._place('parameters')}: {reason}") from None
        for key in parameters:
            if not np.allclose(_numbers(camera.parameters()[key]), known[key], rtol=ROUNDING):
                raise PlanError(
                    f"{self._place(f'parameters.{key}')}: follows from the other parameters: "
                    "expected one of these"
                )
        return camera

    def _degradation(self, before: Degradation, stream: Shares) -> Degradation:
        """Degradation with drawn parameters."""
        tables: dict[str, dict[str, Any]] = dict(before.tables())
        for name, keys in self.table.degradation.items():
            drawn = {key: _number(name, key, one.draw(stream)) for key, one in keys.items()}
            tables[name] = {**tables.get(name, {}), **drawn}
        return parse_degradation(tables, self._place("").removesuffix(": "), self._plan.parent)

    def _exposed(self, camera: OmniCamera) -> OmniCamera:
        """Camera whose exposure can be set for each image."""
        degradation = camera.degradation
        if degradation.is_metered:
            raise PlanError(
                f"{self._plan}: vary.exposure_ev: camera {self.table.title} meters its exposure: "
                "expected degradation.exposure.ev of this camera instead"
            )
        if degradation.exposure is not None:
            return camera
        return camera.with_degradation(dataclasses.replace(degradation, exposure=Exposure()))


def _read_cameras(table: PlanCameraTable, folder: Path) -> dict[str, OmniCamera]:
    if table.sensor is not None:
        return {"": OmniCamera.from_file(folder / table.sensor)}
    if table.optics is not None:
        from omnisim.cameras.optics.system_file import read_optics_file  # few plans have one

        return {"": OmniCamera(read_optics_file(folder / table.optics))}
    if table.calibration is None:
        return {"": OmniCamera()}
    # only plans with a calibration need the formats and fits, which are slow to import
    from omnisim.cameras.calibration import load_calibration
    from omnisim.cameras.calibration.calibration import Rig
    from omnisim.robots.vehicle import rig_vehicle

    calibration = load_calibration(folder / table.calibration, mirrored=table.mirrored)
    if table.camera_name == WHOLE_RIG:
        vehicle = rig_vehicle(table.title, Rig.of(calibration))
        return {mounted.name: mounted.sensor for mounted in vehicle.cameras}
    camera = calibration.camera(table.camera_name)
    return {"": OmniCamera(camera.camera, polygons=None)}


def _numbers(value: Any) -> list[float]:
    """Floats of a camera parameter that is a float or a list of floats; else an empty list."""
    values = value if isinstance(value, list) else [value]
    return values if all(isinstance(one, float) for one in values) else []


def _number(effect: str, key: str, value: float) -> float | int:
    """Drawn value for a key of a degradation, rounded if the key's default is an integer."""
    field = getattr(EFFECTS.get(effect), "__dataclass_fields__", {}).get(key)
    return round(value) if field is not None and isinstance(field.default, int) else value
