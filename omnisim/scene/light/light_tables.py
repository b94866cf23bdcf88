"""Tables of a scene's TOML file for its light: lamps, sun, sky, fog."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from omnisim.core.files.parameters import Flag, Name, Number, Point, Positive, Table, overriding
from omnisim.scene.parts import Fog, Light, LightKind, LinearRgb


def _with_offset(value: Any) -> Any:
    if not isinstance(value, datetime):
        raise ValueError(f"expected a time as 2026-06-21T12:00:00+02:00, got {value!r}")
    if value.tzinfo is None:
        raise ValueError(f"expected a time with an offset from UTC, got {value.isoformat()}")
    return value


Time = Annotated[datetime, BeforeValidator(_with_offset)]


class LightTable(Table):
    """Light of the scene, and the reflectance of its surfaces."""

    shading: Literal["full", "matte"] | None = None
    """full: metal, gloss, maps and emission from the mesh files (default); matte: base colors only,
    Lambertian, also for vehicles and other objects."""
    shadows: Flag | None = None
    """False: no lamp casts shadows; true: all lamps do. Default: as stated in the files, usually
    true. The even light of a scene without lamps casts none."""
    ambient: LinearRgb | None = None
    """Ambient light on a white surface, linear RGB. Default: a little, in addition to lamps.
    [0, 0, 0] also disables the even light of a scene without lamps, so that only emission is
    left."""
    exposure: Positive | None = None
    """Brightness of a white surface per lux of the lamps. Default: chosen so that most lit surfaces
    are not overexposed."""
    baked: Name | None = None
    """Folder of baked light from `omnisim bake`, relative to this file; it replaces the light of
    lamps and sky. Default: no baked light."""

    sky: Literal["none"] | None = None
    """none: drop the sky and the sun of the base scene. Default: keep them, unless this scene has
    its own."""

    @property
    def has_own_light(self) -> bool:
        """True if any key changes the light on surfaces."""
        return bool(self.model_fields_set - {"baked"})


@overriding(
    Light,
    defaults={"color": (1.0, 1.0, 1.0), "range_m": None},
    order=("kind", "position_m", "direction", "intensity", "color", "range_m"),
)
class LampTable(Table):
    """Lamp, in addition to those of the mesh file."""

    if TYPE_CHECKING:
        kind: LightKind
    # a light has both as arrays, and always
    position_m: Point | None = None
    """Position of a point or spot lamp in the world, m."""
    direction: Point | None = None
    """Direction of travel of the light of a directional or spot lamp, of any length."""
    inner_deg: Annotated[Number, Field(ge=0.0, lt=90.0)] | None = None
    """Half-angle of a spot lamp's cone of full brightness, degrees. Default: 0."""
    outer_deg: Annotated[Number, Field(gt=0.0, le=90.0)] | None = None
    """Half-angle of a spot lamp at which its light ends, degrees. Default: 45."""
    shadows: Flag = True
    """Cast shadows."""

    @model_validator(mode="after")
    def _fits_kind(self) -> LampTable:
        kind = self.kind.value
        needed = {"directional": ("direction",), "point": ("position_m",)}.get(
            kind, ("position_m", "direction")
        )
        for key in ("position_m", "direction", "inner_deg", "outer_deg", "range_m"):
            given = getattr(self, key) is not None
            if key in needed and not given:
                raise ValueError(f"{key}: missing; a {kind} lamp needs it")
            if given and key in _FOREIGN[kind]:
                raise ValueError(f"{key}: expected none for a {kind} lamp")
        if self.direction == (0.0, 0.0, 0.0):
            raise ValueError("direction: expected a length other than 0")
        if not (self.inner_deg or 0.0) < (45.0 if self.outer_deg is None else self.outer_deg):
            raise ValueError("inner_deg: expected less than outer_deg")
        return self


_FOREIGN = {
    "directional": ("position_m", "range_m", "inner_deg", "outer_deg"),
    "point": ("direction", "inner_deg", "outer_deg"),
    "spot": (),
}


@overriding(Light, "color", defaults={"color": (1.0, 0.97, 0.90)})
class SunTable(Table):
    """Sun in a clear sky for a time and place: a directional lamp."""

    if TYPE_CHECKING:
        color: LinearRgb
    time: Time
    """Time with its UTC offset, such as 2026-06-21T12:00:00+02:00."""
    latitude_deg: Annotated[Number, Field(ge=-90.0, le=90.0)]
    """Latitude of the scene, degrees, positive in the north."""
    longitude_deg: Annotated[Number, Field(ge=-180.0, le=180.0)]
    """Longitude of the scene, degrees, positive in the east."""
    north_deg: Number = 90.0
    """Direction of north, degrees counter-clockwise from the world's x. Default: the world's y."""
    illuminance_lx: Positive | None = None
    """Illuminance of a surface that faces the sun, lx. Default: computed from its elevation."""
    shadows: Flag = True
    """Cast shadows."""


@overriding(Fog, defaults={"attenuation_per_m": None}, order=("color", "visibility_m"))
class FogTable(Table):
    """Homogeneous fog or water between the camera and the surfaces."""

    if TYPE_CHECKING:
        attenuation_per_m: tuple[float, float, float] | None
    visibility_m: Positive | None = None
    """Distance at which 5 % of the contrast remains, m."""

    @model_validator(mode="after")
    def _one_measure(self) -> FogTable:
        if (self.visibility_m is None) == (self.attenuation_per_m is None):
            raise ValueError("expected either visibility_m or attenuation_per_m")
        return self


class SkyTable(Table):
    """Sky that lights the scene and forms its background, instead of even light."""

    file: Name | None = None
    """Environment map, .hdr or .exr, relative to this file, twice as wide as high, with the world's
    x in its center before yaw_deg. Default: a clear sky."""
    yaw_deg: Number = 0.0
    """Rotation of the map, degrees counter-clockwise seen from above."""
    brightness: Positive = 0.8
    """Brightness of a horizontal white surface under the sky and the sun; 1 is white. With [sun]
    and light.exposure, that exposure applies instead."""
    turbidity: Annotated[Number, Field(ge=2.0, le=10.0)] = 3.0
    """Turbidity of the clear sky: 2 very clear, 6 hazy."""
    sun_elevation_deg: Annotated[Number, Field(gt=0.0, le=90.0)] = 45.0
    """Elevation of the clear sky's sun, degrees; only without [sun]."""
    sun_azimuth_deg: Number = 135.0
    """Azimuth of the clear sky's sun, degrees counter-clockwise from the world's x; only without
    [sun]."""

    @model_validator(mode="after")
    def _one_sky(self) -> SkyTable:
        of_clear_sky = {"turbidity", "sun_elevation_deg", "sun_azimuth_deg"}
        if self.file is not None and (given := of_clear_sky & self.model_fields_set):
            raise ValueError(f"{min(given)}: expected a clear sky, got file = {self.file!r}")
        if self.file is None and "yaw_deg" in self.model_fields_set:
            raise ValueError("yaw_deg: requires file, an environment map")
        return self
