"""Sensor files: the paper's three groups of USARBot.ini (section 2.4) in TOML.

`paper.toml` beside this module has every key, with its default and its help: written by
`python docs/_ext/reference_pages.py`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic
from pydantic import ConfigDict, Field, model_validator

from omnisim.cameras import CentralCamera, HyperbolicCamera
from omnisim.cameras.camera_table import camera_from_calibration, camera_from_table
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.mirror_mesh import sectors_and_rings
from omnisim.cameras.models.field_of_view import field_notes
from omnisim.core.errors import NoticeWarning, OpticsError, SensorFileError
from omnisim.core.files.parameters import (
    AboveZero,
    Number,
    Table,
    described,
    overriding,
    parse_table,
)
from omnisim.core.files.toml_file import extended, read_tables
from omnisim.rendering.camera.degradations.degradation_file import parse_degradation
from omnisim.rendering.camera.quality import (
    DEFAULT_QUALITY,
    MAX_IMAGE_PX,
    Capture,
    QualityName,
    Size,
    max_polygons,
    quality_named,
)
from omnisim.rendering.sensor import MountingTable

Polygons = int | Literal["auto"] | None  # None: exact
NARROW_DEG = 5.0  # half of a field of view below which a notice asks about the unit
# Tables of the base that a table of the extending file excludes.
_RIVALS = {
    "lens": ("mirror", "camera", "optics"),
    "optics": ("mirror", "camera", "lens"),
    "mirror": ("lens", "optics"),
}
DEFAULT_SENSOR_FILE = Path(__file__).with_name("paper.toml")
PolygonCount = Annotated[
    Literal["auto", "exact"] | pydantic.StrictInt, described("a whole number, 'auto' or 'exact'")
]
FaceSize = Annotated[Literal["auto"] | Size, described(f"1 to {MAX_IMAGE_PX} or 'auto'")]
FocalLength = Annotated[Literal["fit"] | AboveZero, described("a number > 0 or 'fit'")]
PrincipalPoint = Annotated[
    Literal["center"] | tuple[Number, Number], described("[u, v] in pixels or 'center'")
]


@overriding(HyperbolicMirror, defaults={})
class MirrorTable(Table):
    """First group: the static mirror mesh."""

    shape: Literal["hyperbolic"] = "hyperbolic"
    """Profile of the mirror: Baker and Nayar's hyperboloid, the paper's Eq. 1."""
    rim_radius_m: AboveZero | None = None
    """Radius of the rim in meters, instead of theta_max_deg."""
    polygons: PolygonCount = "auto"
    """Polygons of the mesh: 16, 64, 256, 1024 (the paper's), 4096, …; "auto": the fewest that keep
    the largest error in the image below 0.1 px; "exact": no mesh."""
    mounting: MountingTable = Field(default_factory=MountingTable)

    @model_validator(mode="after")
    def _at_most_one_rim(self) -> MirrorTable:
        if "theta_max_deg" in self.model_fields_set and self.rim_radius_m is not None:
            raise ValueError(
                "theta_max_deg and rim_radius_m both say where the rim is: expected one of them"
            )
        return self

    def make_mirror(self, source: str) -> HyperbolicMirror:
        """Make the mirror.

        Raises:
            SensorFileError: the values contradict each other.
        """
        keys = dict(self)  # those of the mirror among them
        shape = {key: keys[key] for key in ("k", "c", "meters_per_unit")}
        theta_max_deg: float = keys["theta_max_deg"]
        _warn_of_narrow_field(theta_max_deg, f"{source}: mirror")
        try:
            if self.rim_radius_m is not None:
                given = f"rim_radius_m = {self.rim_radius_m}"
                return HyperbolicMirror.with_rim_radius(self.rim_radius_m, **shape)
            given = f"theta_max_deg = {theta_max_deg:.15g}"
            return HyperbolicMirror(**shape, theta_max_rad=math.radians(theta_max_deg))
        except OpticsError as reason:
            raise _fault(f"{source}: mirror.{given}: ", reason, "mirror") from None


@overriding(Capture, "texels_per_pixel")
@overriding(Capture, "near_m", "far_m", "samples", "mirrors", "reflection_probes", defaults={})
class VirtualCamerasTable(Table):
    """Second group: the cameras at the effective viewpoint."""

    size_px: FaceSize = "auto"
    """Texels across the 90°; "auto": as texels_per_pixel requires."""


@overriding(Capture, "supersampling")
class CameraTable(Table):
    """Third group: the camera that looks at the mirror."""

    width_px: Size = 360
    """Width of the image in pixels."""
    height_px: Size = 360
    """Height of the image in pixels."""
    focal_length_px: FocalLength = "fit"
    """Focal length in pixels; "fit": the rim touches the nearest edges of the image."""
    principal_point_px: PrincipalPoint = "center"
    """(u, v) of the optical axis in pixels, (0, 0) at the center of the top left pixel; "center":
    the middle of the image."""
    quality: QualityName = DEFAULT_QUALITY
    """Capture quality by name: fast is supersampling 2 and texels_per_pixel 1, default 3 and 2.9,
    fine 4 and 4."""

    def make_camera(self, mirror: HyperbolicMirror, source: str) -> HyperbolicCamera:
        """The camera below a mirror; `source` names the file in messages."""
        camera = HyperbolicCamera.framed_on_rim(mirror, self.width_px, self.height_px)
        try:
            if self.focal_length_px != "fit":
                camera = replace(camera, focal_length_px=self.focal_length_px)
            if self.principal_point_px != "center":
                camera = replace(camera, principal_point_px=self.principal_point_px)
        except OpticsError as reason:
            raise _fault(f"{source}: camera.", reason, "camera") from None
        return camera


class LensTable(Table):
    """Camera that replaces the first and third group.

    Either a model with its own parameters as further keys, or a calibration file.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    model: str | None = None
    """Name of the camera model; its parameters are further keys of this table."""
    calibration: str | None = None
    """Calibration file, relative to this file, instead of model. Beside it, `theta_max_deg` ends
    the field of view at an angle from the axis; with `mirrored = true` the camera looks into a
    mirror, by default as omnisim's metadata in the file states."""
    camera: str | None = None
    """Name of a camera in the calibration file; left out: the first."""
    mounting: MountingTable = Field(default_factory=MountingTable)

    @model_validator(mode="after")
    def _model_or_calibration(self) -> LensTable:
        if self.model is None and self.calibration is None:
            raise ValueError("model: missing; expected it, or calibration with the name of a file")
        return self

    def make_camera(self, source: str) -> CentralCamera:
        """Make the camera from these parameters, or from the calibration file.

        Raises:
            SensorFileError: names the key and the expected value.
        """
        extra = dict(self.__pydantic_extra__ or {})
        keys = extra if self.model is None else {"model": self.model, **extra}
        _warn_of_narrow_field(extra.get("theta_max_deg"), f"{source}: lens")
        if self.calibration is not None:
            of_file = self.calibration, self.camera, keys, source, "lens"
            return camera_from_calibration(*of_file, ("theta_max_deg", "mirrored"))
        if self.camera is not None:
            reason = "is a name in a calibration file: expected calibration"
            raise SensorFileError(f"{source}: lens.camera: {reason}")
        camera = camera_from_table(keys, source, "lens")
        for note in field_notes(camera):
            warnings.warn(f"{source}: lens: {note}", NoticeWarning, stacklevel=2)
        return camera


class OpticsTable(Table):
    """Non-central optical system that replaces the first and third group.

    Either a file, or the keys of an optics file as further keys: `[optics.camera]`,
    `[[optics.surfaces]]` and so on.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    file: str | None = None
    """Optics file, relative to this file; left out: its keys are in this table, as
    [optics.camera] and [[optics.surfaces]]."""
    polygons: PolygonCount = "exact"
    """Polygons of the mesh of the first mirror that the camera sees; "auto": as few as keep the
    largest error in the image below 0.1 px; "exact": no mesh."""
    mounting: MountingTable = Field(default_factory=MountingTable)

    def polygon_count(self, camera: CentralCamera, source: str) -> Polygons:
        """Polygons of a camera's mesh; None: exact.

        Raises:
            SensorFileError: the count does not make a mesh, or no mirror has one.
        """
        found = _polygon_count(self.polygons, f"{source}: optics")
        if isinstance(found, int) and max_polygons(camera) is None:
            expected = "expected 'auto' or 'exact', as there is no mirror with a rim"
            raise SensorFileError(f"{source}: optics.polygons = {found}: {expected}")
        return found

    def make_camera(self, source: str) -> CentralCamera:
        """Make the optical system of the file, or of the further keys.

        Raises:
            SensorFileError: names the file, its key and the expected value.
        """
        # few have one
        from omnisim.cameras.optics.system_file import parse_optics, read_optics_file

        extra = dict(self.__pydantic_extra__ or {})
        if self.file is None:
            return parse_optics(extra, source, "optics")
        if extra:
            reason = "expected none with optics.file, which states it"
            raise SensorFileError(f"{source}: optics.{min(extra)}: {reason}")
        return read_optics_file(Path(source).parent / self.file)


class SensorFile(Table):
    """Sensor file: a mirror and the camera that looks at it, a lens, or optics."""

    extends: str | None = None
    """Sensor file that this one extends, relative to this one. Keys here replace its keys; a
    `[lens]` or `[optics]` here also replaces its mirror and camera."""
    mirror: MirrorTable = Field(default_factory=MirrorTable)
    virtual_cameras: VirtualCamerasTable = Field(default_factory=VirtualCamerasTable)
    camera: CameraTable = Field(default_factory=CameraTable)
    lens: LensTable | None = None
    optics: OpticsTable | None = None
    degradation: dict[str, Any] = Field(default_factory=dict)
    """Table of the effects of a non-ideal camera, see the degradations; left out: ideal."""

    @model_validator(mode="after")
    def _mirror_or_lens(self) -> SensorFile:
        given = [name for name in ("lens", "optics") if getattr(self, name) is not None]
        given += ["mirror"] if "mirror" in self.model_fields_set else []
        if len(given) > 1:
            words = "both define the camera: expected one of them"
            raise ValueError(f"[{given[0]}] and [{given[1]}] {words}")
        extra = self.camera.model_fields_set - {"quality", "supersampling"}
        if extra and given in (["lens"], ["optics"]):
            owner = "[lens]" if self.lens is not None else "[optics.camera] or the optics file"
            raise ValueError(f"camera.{min(extra)}: expected it in {owner}")
        return self


def read_sensor_file(path: Path) -> dict[str, Any]:
    """Read a sensor file, or an optics file, which implies default settings.

    Returns:
        Arguments of `OmniCamera`.

    Raises:
        SensorFileError: names file, key, value and the expected value.
    """
    table = read_tables(path, SensorFileError)
    if not path.stat().st_size:
        warnings.warn(f"{path}: is empty: the paper's camera is used", NoticeWarning, stacklevel=2)
    if "surfaces" not in table or "optics" in table:
        return parse_sensor(table, str(path))
    from omnisim.cameras.optics.system_file import parse_optics  # few have one

    return {"model": parse_optics(table, str(path)), "polygons": None}


def extended_sensor(table: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Tables of a sensor file and of those that it extends, without validation.

    Raises:
        SensorFileError: a file is missing, or cannot be read.
    """
    return extended(table, source, SensorFileError, rivals=_RIVALS)


def parse_sensor(table: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Read a table with the keys of a sensor file; `source` names it in messages.

    Returns:
        Arguments of `OmniCamera`.

    Raises:
        SensorFileError: names source, key, value and the expected value.
    """
    whole = extended_sensor(table, source)
    file = parse_table(whole, SensorFile, SensorFileError, source)
    model: CentralCamera
    polygons: Polygons
    if file.lens is not None:
        model, polygons, mounting = file.lens.make_camera(source), None, file.lens.mounting
    elif file.optics is not None:
        model, mounting = file.optics.make_camera(source), file.optics.mounting
        polygons = file.optics.polygon_count(model, source)
    else:
        polygons = _polygon_count(file.mirror.polygons, f"{source}: mirror")
        model = file.camera.make_camera(file.mirror.make_mirror(source), source)
        mounting = file.mirror.mounting
    given = {**dict(file.virtual_cameras), **quality_named(file.camera.quality)._asdict()}
    for keys in (file.virtual_cameras, file.camera):
        given |= {key: value for key, value in keys if key in given and value is not None}
    size_px = given.pop("size_px")
    try:
        Capture(**given)  # raises if they do not fit each other
    except OpticsError as reason:
        raise SensorFileError(f"{source}: virtual_cameras.{reason}") from None
    return {
        "model": model,
        "polygons": polygons,
        "base_from_rig": mounting.base_from_mount,
        "face_size_px": None if size_px == "auto" else size_px,
        "degradation": parse_degradation(file.degradation, source, Path(source).parent),
        **given,
    }


def _warn_of_narrow_field(theta_max_deg: object, place: str) -> None:
    """Notice about an angle that is likely in radians; `place` names file and table."""
    if isinstance(theta_max_deg, int | float) and 0.0 < theta_max_deg < NARROW_DEG:
        hint = f"; {theta_max_deg:g} rad would be {math.degrees(theta_max_deg):.1f}°"
        warnings.warn(
            f"{place}.theta_max_deg = {theta_max_deg:g}: a field of view of "
            f"{2.0 * theta_max_deg:g}°{hint if theta_max_deg <= math.pi else ''}",
            NoticeWarning,
            stacklevel=2,
        )


def _fault(where: str, reason: OpticsError, prefix: str) -> SensorFileError:
    """Convert an optics error to a sensor-file error; the file's key replaces its prefix."""
    text = str(reason).removeprefix(f"{prefix}: ").removeprefix(f"{prefix}.")
    return SensorFileError(where + text)


def _polygon_count(polygons: int | Literal["auto", "exact"], where: str) -> Polygons:
    """Polygons of a mesh; None: exact.

    Raises:
        SensorFileError: the count does not make a mesh.
    """
    if isinstance(polygons, int):
        try:
            sectors_and_rings(polygons)
        except OpticsError as reason:
            raise _fault(f"{where}.polygons = {polygons}: ", reason, "mirror") from None
    return None if polygons == "exact" else polygons
