"""Cameras and light of a plan."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.core.errors import OmnisimError, PlanError, did_you_mean
from omnisim.core.files.parameters import parse_table
from omnisim.core.files.sources import SourceReader, recorded_sources
from omnisim.core.poses import pose
from omnisim.datasets.generate.distributions import Distribution, Shares
from omnisim.datasets.generate.plan import PlanCameraTable, VaryLightTable, VarySkyTable, VaryTable
from omnisim.rendering.camera.captured_image import camera_of_parameters
from omnisim.rendering.camera.degradations import Degradation, Exposure, preset
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS, parse_degradation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene import Scene
from omnisim.scene.light.light_tables import LightTable, SkyTable
from omnisim.scene.light.sky import sun_position, with_sky
from omnisim.scene.parts import LightKind

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
    """Cameras of one [[cameras]] table of a plan; their file, one of `sources`, is read once.

    Raises:
        OmnisimError: a faulty file.
    """

    def __init__(self, table: PlanCameraTable, plan: Path, is_exposed: bool):
        self.table, self._plan = table, plan
        self._is_exposed = is_exposed  # True: the exposure varies between images
        with recorded_sources() as self.sources:
            self._read = _read_cameras(table, plan.parent)
            if table.preset is not None:
                preset(table.preset, plan.parent)

    def rig(self, stream: Shares | None = None) -> PlanRig:
        """Rig with its size, quality and degradations, and what varies drawn from a stream.

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
                    f"{self._place(f'parameters.{key}')}: not a parameter of {model.model_name!r}: "
                    f"{did_you_mean(key, existing, 'expected one of')}"
                )
            known[key] = [number + distribution.draw(stream) for number in numbers]
            wanted[key] = known[key] if isinstance(wanted[key], list) else known[key][0]
        try:
            camera = camera_of_parameters(wanted)
        except OmnisimError as reason:
            raise PlanError(f"{self._place('parameters')}: {reason}") from None
        for key in parameters:
            if not np.allclose(_numbers(camera.parameters()[key]), known[key], rtol=ROUNDING):
                raise PlanError(
                    f"{self._place(f'parameters.{key}')}: follows from the other parameters: "
                    "vary those instead"
                )
        return camera

    def _degradation(self, before: Degradation, stream: Shares) -> Degradation:
        """Degradation with drawn parameters."""
        tables: dict[str, dict[str, Any]] = dict(before.tables())
        for name, keys in self.table.degradation.items():
            fields = getattr(EFFECTS.get(name), "__dataclass_fields__", {})
            table = tables[name] = dict(tables.get(name, {}))
            for key, distribution in keys.items():
                value, field = distribution.draw(stream), fields.get(key)
                is_whole = field is not None and isinstance(field.default, int)
                table[key] = round(value) if is_whole else value
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
    return values if all(isinstance(number, float) for number in values) else []


# Light of a setup: drawn lamps and sky of a scene.


YEAR = datetime(2026, 1, 1, tzinfo=UTC)
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB, Rec. 709
_SRGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


@dataclass(frozen=True, eq=False)
class DrawnLight:
    """Scene with drawn light."""

    scene: Scene  # scene with the lighting
    values: dict[str, Any]  # drawn values, of JSON types


def draw_light(scene: Scene, vary: VaryTable, stream: Shares, plan: Path) -> DrawnLight:
    """Draw the light of a scene by the table [vary]; maps are relative to the file of the plan.

    Raises:
        OmnisimError: the sun is below the horizon, or a map cannot be read.
    """
    values: dict[str, Any] = {}
    if vary.light is not None:
        values["light"] = _draw_lamps(vary.light, len(scene.lighting.lights), stream)
        scene = _lit(scene, values["light"])
    if vary.sky is not None:
        values["sky"] = _draw_sky(vary.sky, stream, plan)
        scene = _under_sky(scene, values["sky"], plan)
    return DrawnLight(scene, values)


def _draw_sky(table: VarySkyTable, stream: Shares, plan: Path) -> dict[str, Any]:
    """Drawn keys and values for a scene file's [sky]."""
    yaw_deg, brightness = table.yaw_deg.draw(stream), table.brightness.draw(stream)
    if table.files:
        file = table.files[min(int(stream.share() * len(table.files)), len(table.files) - 1)]
        return {"file": file, "yaw_deg": yaw_deg, "brightness": brightness}
    sky = {"brightness": brightness, "turbidity": table.turbidity.draw(stream)}
    if table.hour is None:
        sky["sun_elevation_deg"] = table.sun_elevation_deg.draw(stream)
        sky["sun_azimuth_deg"] = table.sun_azimuth_deg.draw(stream)
        return sky
    hour, day = table.hour.draw(stream), table.day.draw(stream)
    time = YEAR + timedelta(days=round(day) - 1, hours=hour)
    sun = sun_position(time, table.latitude_deg.draw(stream), 0.0)
    if sun.elevation_deg <= 0.0:
        raise PlanError(
            f"{plan}: vary.sky.hour = {hour:.3g}: expected a sun above the horizon, got "
            f"{sun.elevation_deg:.3g}°"
        )
    sky["sun_elevation_deg"] = sun.elevation_deg
    sky["sun_azimuth_deg"] = 90.0 + yaw_deg - sun.azimuth_deg
    return sky


def _under_sky(scene: Scene, sky: dict[str, Any], plan: Path) -> Scene:
    """Scene with a drawn sky instead of its own sky and directional lamps."""
    lamps = (lamp for lamp in scene.lighting.lights if lamp.kind is not LightKind.DIRECTIONAL)
    lighting = dataclasses.replace(scene.lighting, lights=tuple(lamps), environment=None)
    scene = dataclasses.replace(scene, lighting=lighting)
    table = parse_table(sky, SkyTable, PlanError, f"{plan}: vary", "sky")
    return with_sky(scene, table, LightTable(), None, f"{plan}: vary", plan.parent, SourceReader())


def _draw_lamps(table: VaryLightTable, count: int, stream: Shares) -> dict[str, Any]:
    """Drawn factors of the ambient light and the lamps, and the lamps' temperatures in K."""
    values: dict[str, Any] = {"ambient_factor": table.ambient_factor.draw(stream)}
    values["lamp_factors"] = [table.lamp_factor.draw(stream) for _ in range(count)]
    if (kelvin := table.lamp_temperature_k) is not None:
        values["lamp_temperatures_k"] = [kelvin.draw(stream) for _ in range(count)]
    return values


def _lit(scene: Scene, values: dict[str, Any]) -> Scene:
    """Scene with drawn values applied to lamps and ambient light, and without baked light."""
    lighting = scene.lighting
    lamps = [
        dataclasses.replace(lamp, intensity=factor * lamp.intensity)
        for lamp, factor in zip(lighting.lights, values["lamp_factors"], strict=True)
    ]
    for index, kelvin in enumerate(values.get("lamp_temperatures_k", ())):
        level = float(_LUMINANCE @ lamps[index].color)  # the luminance stays
        red, green, blue = (level * value for value in black_body_rgb(kelvin))
        lamps[index] = dataclasses.replace(lamps[index], color=(red, green, blue))
    red, green, blue = (values["ambient_factor"] * value for value in lighting.ambient)
    lit = dataclasses.replace(lighting, lights=tuple(lamps), ambient=(red, green, blue), baked=None)
    return dataclasses.replace(scene, lighting=lit)


def black_body_rgb(kelvin: float) -> tuple[float, float, float]:
    """Linear sRGB of a black body from 1667 K to 25 000 K, with luminance 1.

    Source: Kim et al., "Design of advanced color temperature control system for HDTV
    applications", 2002: a cubic fit of the Planckian locus in CIE xy.
    """
    inverse = 1000.0 / kelvin
    powers = np.array([inverse**3, inverse**2, inverse, 1.0])
    if kelvin <= 4000.0:
        x = float(np.dot((-0.2661239, -0.2343589, 0.8776956, 0.179910), powers))
    else:
        x = float(np.dot((-3.0258469, 2.1070379, 0.2226347, 0.240390), powers))
    if kelvin <= 2222.0:
        y = float(np.polyval((-1.1063814, -1.34811020, 2.18555832, -0.20219683), x))
    elif kelvin <= 4000.0:
        y = float(np.polyval((-0.9549476, -1.37418593, 2.09137015, -0.16748867), x))
    else:
        y = float(np.polyval((3.0817580, -5.87338670, 3.75112997, -0.37001483), x))
    rgb = np.maximum(_SRGB_FROM_XYZ @ (x / y, 1.0, (1.0 - x - y) / y), 0.0)
    red, green, blue = (rgb / (_LUMINANCE @ rgb)).tolist()
    return red, green, blue
