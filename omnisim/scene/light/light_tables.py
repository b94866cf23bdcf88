"""Tables of a scene's TOML about its light: lamps, the sun, fog."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from omnisim.core.files.parameters import (
    Flag,
    Name,
    NotNegative,
    Number,
    Point,
    Positive,
    Table,
)

LinearRgb = tuple[NotNegative, NotNegative, NotNegative]


def _native(value: Any) -> Any:
    if not isinstance(value, datetime):
        raise ValueError(f"expected a time as 2026-06-21T12:00:00+02:00, got {value!r}")
    return value


def _with_offset(value: datetime) -> datetime:
    if value.tzinfo is None:
        raise ValueError(f"expected a time with an offset from UTC, got {value.isoformat()}")
    return value


Time = Annotated[datetime, BeforeValidator(_native), AfterValidator(_with_offset)]


class LightTable(Table):
    """Light of the scene, and how surfaces reflect it."""

    shading: Literal["full", "matte"] | None = None
    """full: metal, gloss, maps and emission as the mesh files have them, which is the default;
    matte: base colors alone, by Lambert's law, also of vehicles and other objects."""
    shadows: Flag | None = None
    """False: no lamp casts shadows; true: all do; left out: as the files have it, which is true in
    most. Even light, of a scene without lamps, casts none."""
    ambient: LinearRgb | None = None
    """Light from everywhere on a white surface, linear RGB; left out: a little, beside lamps."""
    exposure: Positive | None = None
    """Brightness of a white surface for one lux of the lamps; left out: so that most of the lit
    surfaces are not overexposed."""
    baked: Name | None = None
    """Folder of baked light, relative to this file, as `omnisim bake` writes it, in place of the
    light of lamps and sky; left out: none."""

    sky: Literal["none"] | None = None
    """none: without the sky and the sun of the scene that this one extends; left out: with them,
    unless this one has some."""

    @property
    def has_own_light(self) -> bool:
        """Some key changes the light on surfaces."""
        return bool(self.model_fields_set - {"baked"})


class LampTable(Table):
    """Lamp, beside those of the mesh file."""

    kind: Literal["directional", "point", "spot"]
    """Kind of lamp, as in glTF: directional ones are far away."""
    position_m: Point | None = None
    """Position of a point or spot lamp, meters in the world."""
    direction: Point | None = None
    """Direction in which the light of a directional or spot lamp travels, of any length."""
    intensity: Positive
    """Lux of a directional lamp, candela of others."""
    color: LinearRgb = (1.0, 1.0, 1.0)
    """Linear RGB that multiplies the intensity."""
    range_m: Positive | None = None
    """Distance at which the light of a point or spot lamp ends, meters; left out: nowhere."""
    inner_deg: Annotated[Number, Field(ge=0.0, lt=90.0)] | None = None
    """Angle from a spot lamp's axis up to which it is as bright; left out: 0."""
    outer_deg: Annotated[Number, Field(gt=0.0, le=90.0)] | None = None
    """Angle from a spot lamp's axis at which its light ends; left out: 45."""
    shadows: Flag = True
    """True: it casts shadows."""

    @model_validator(mode="after")
    def _fits_kind(self) -> LampTable:
        needed = {"directional": ("direction",), "point": ("position_m",)}.get(
            self.kind, ("position_m", "direction")
        )
        for key in ("position_m", "direction", "inner_deg", "outer_deg", "range_m"):
            given = getattr(self, key) is not None
            if key in needed and not given:
                raise ValueError(f"{key}: missing; a {self.kind} lamp has one")
            if given and key in _FOREIGN[self.kind]:
                raise ValueError(f"{key}: expected none of a {self.kind} lamp")
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


class SunTable(Table):
    """Sun in a clear sky at a time and place: a directional lamp."""

    time: Time
    """Time with its offset from UTC, as 2026-06-21T12:00:00+02:00."""
    latitude_deg: Annotated[Number, Field(ge=-90.0, le=90.0)]
    """Latitude of the scene, positive in the north."""
    longitude_deg: Annotated[Number, Field(ge=-180.0, le=180.0)]
    """Longitude of the scene, positive in the east."""
    north_deg: Number = 90.0
    """Direction of north, counter-clockwise from the world's x: by default its y."""
    illuminance_lx: Positive | None = None
    """Lux on a surface that faces it; left out: by its height in a clear sky."""
    color: LinearRgb = (1.0, 0.97, 0.90)
    """Linear RGB that multiplies it."""
    shadows: Flag = True
    """True: it casts shadows."""


class FogTable(Table):
    """Fog, or water, between the camera and what it sees: the same everywhere."""

    color: LinearRgb
    """Linear RGB of what is infinitely far away."""
    visibility_m: Positive | None = None
    """Distance at which 5 % of the contrast is left, meters."""
    attenuation_per_m: tuple[NotNegative, NotNegative, NotNegative] | None = None
    """Attenuation of R, G and B for each meter, in place of visibility_m: water takes red first."""

    @model_validator(mode="after")
    def _one_measure(self) -> FogTable:
        if (self.visibility_m is None) == (self.attenuation_per_m is None):
            raise ValueError("expected either visibility_m or attenuation_per_m")
        return self


class SkyTable(Table):
    """Sky that lights the scene and is seen behind it, instead of even light."""

    file: Name | None = None
    """Environment map, .hdr or .exr, relative to this file; left out: a clear sky. It is twice as
    wide as high; its middle is the world's x, before yaw_deg."""
    yaw_deg: Number = 0.0
    """Turn of the map in degrees, counter-clockwise seen from above."""
    brightness: Positive = 0.8
    """Brightness of a level white surface under the sky and the sun; 1 is white. With [sun] and
    light.exposure that exposure counts instead."""
    turbidity: Annotated[Number, Field(ge=2.0, le=10.0)] = 3.0
    """Haze of the clear sky: 2 very clear, 6 hazy."""
    sun_elevation_deg: Annotated[Number, Field(gt=0.0, le=90.0)] = 45.0
    """Height of the clear sky's sun above the horizon, degrees; without [sun]."""
    sun_azimuth_deg: Number = 135.0
    """Direction of the clear sky's sun, degrees counter-clockwise from the world's x; without
    [sun]."""

    @model_validator(mode="after")
    def _one_sky(self) -> SkyTable:
        of_clear_sky = {"turbidity", "sun_elevation_deg", "sun_azimuth_deg"}
        if self.file is not None and (given := of_clear_sky & self.model_fields_set):
            raise ValueError(f"{min(given)}: expected a clear sky, got file = {self.file!r}")
        if self.file is None and "yaw_deg" in self.model_fields_set:
            raise ValueError("yaw_deg: expected an environment map in file")
        return self
