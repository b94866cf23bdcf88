"""Tables of a plan for variation: attitude, time, light, sky and colors."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from omnisim.core.files.parameters import MAX_NUMBER, Fraction, Name, Table
from omnisim.datasets.generate.distributions import Distributed, Distribution, within

MAX_IMAGES = 100_000  # per shard or setup
COLDEST_K, HOTTEST_K = 1667.0, 25_000.0  # range of the fit of black bodies' colors


def fixed(value: float) -> Distribution:
    """Distribution of one number."""
    return Distribution("constant", (value,))


class RecolorTable(Table):
    """Instances with an individual color in each image."""

    nodes: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of the instances; `*` and `?` stand for any letters."""
    hue_deg: Distributed = Distribution("uniform", (0.0, 360.0))
    """Hue of the color, degrees."""
    saturation: Annotated[Distributed, within(0.0, 1.0)] = Distribution("uniform", (0.0, 0.9))
    """Saturation, 0 to 1."""
    value: Annotated[Distributed, within(0.0, 1.0)] = Distribution("uniform", (0.2, 0.95))
    """Value in HSV, 0 to 1."""
    share: Fraction = 1.0
    """Share of the images with such a color."""


class VaryLightTable(Table):
    """Lamps and ambient light of the scenes, by setup; the sun of [vary.sky] stays as it is."""

    lamp_factor: Distributed = fixed(1.0)
    """Factor of each lamp's intensity, at least 0; drawn for each lamp."""
    lamp_temperature_k: Distributed | None = None
    """Color temperature of each lamp in kelvin; left out: the lamps' own colors."""
    ambient_factor: Distributed = fixed(1.0)
    """Factor of the ambient light, at least 0."""

    @model_validator(mode="after")
    def _is_light(self) -> VaryLightTable:
        for key in ("lamp_factor", "ambient_factor"):
            if (low := getattr(self, key).low) < 0.0:
                raise ValueError(f"{key}: expected factors of at least 0, got {low:g}")
        kelvin = self.lamp_temperature_k
        if kelvin is not None and not (kelvin.low >= COLDEST_K and kelvin.high <= HOTTEST_K):
            raise ValueError(
                f"lamp_temperature_k: expected {COLDEST_K:g} to {HOTTEST_K:g}, got {kelvin}"
            )
        return self


class VarySkyTable(Table):
    """Sky of the scenes, by setup, instead of their own sky and directional lamps.

    Environment maps, if there are files; otherwise a clear sky with its sun.
    """

    files: tuple[Name, ...] = ()
    """Environment maps, .hdr or .exr, relative to the plan; one per setup."""
    yaw_deg: Distributed = Distribution("uniform", (-180.0, 180.0))
    """Rotation of the map, or of north, in degrees, counter-clockwise seen from above."""
    brightness: Annotated[Distributed, within(0.0, MAX_NUMBER)] = fixed(0.8)
    """Brightness of a level white surface under sky and sun; 1 is white."""
    turbidity: Annotated[Distributed, within(2.0, 10.0)] = Distribution("uniform", (2.0, 6.0))
    """Haze of the clear sky: 2 very clear, 6 hazy."""
    hour: Annotated[Distributed, within(0.0, 24.0)] | None = None
    """Solar time in hours, at which the sun is above the horizon; left out: the sun's height and
    direction are drawn."""
    day: Annotated[Distributed, within(1.0, 366.0)] = fixed(172.0)
    """Day of the year, 1 to 365, for hour."""
    latitude_deg: Annotated[Distributed, within(-90.0, 90.0)] = fixed(50.0)
    """Latitude in degrees, for hour."""
    sun_elevation_deg: Annotated[Distributed, within(0.0, 90.0)] = Distribution(
        "uniform", (15.0, 75.0)
    )
    """Height of the sun above the horizon in degrees; without hour."""
    sun_azimuth_deg: Distributed = Distribution("uniform", (-180.0, 180.0))
    """Direction of the sun in degrees, counter-clockwise from the world's x; without hour."""

    @model_validator(mode="after")
    def _one_sky(self) -> VarySkyTable:
        given = self.model_fields_set
        clear = {"turbidity", "hour", "day", "latitude_deg", "sun_elevation_deg", "sun_azimuth_deg"}
        if self.files and (others := clear & given):
            raise ValueError(f"{min(others)}: expected a clear sky, got files")
        of_hour, of_sun = {"day", "latitude_deg"}, {"sun_elevation_deg", "sun_azimuth_deg"}
        if self.hour is not None and (others := of_sun & given):
            raise ValueError(f"{min(others)}: expected none beside hour")
        if self.hour is None and (others := of_hour & given):
            raise ValueError(f"{min(others)}: expected an hour beside it")
        return self


class VaryTable(Table):
    """Attitude, time, light and colors of the images."""

    yaw_deg: Distributed = Distribution("uniform", (-180.0, 180.0))
    """Heading in degrees from the world's x; for `path`, `around` and `poses`, relative to the
    path, to the object's direction or to the pose, and 0 by default."""
    pitch_deg: Distributed = fixed(0.0)
    """Pitch of the vehicle in degrees: positive: front down."""
    roll_deg: Distributed = fixed(0.0)
    """Roll of the vehicle in degrees: positive: left side up."""
    shift_m: Distributed = fixed(0.0)
    """Shift of the camera on its vehicle along each axis in meters: errors of the mount."""
    time_s: Distributed = fixed(0.0)
    """Time of the world in seconds, for scenes with moving objects."""
    exposure_ev: Distributed = fixed(0.0)
    """Exposure of each image in stops, in addition to the camera's: 1 doubles the light."""
    images_per_setup: Annotated[int, Field(strict=True, ge=1, le=MAX_IMAGES)] = 25
    """Number of successive samples with the same setup: light, sky, and varying cameras; opening a
    new setup takes as long as several images."""
    light: VaryLightTable | None = None
    sky: VarySkyTable | None = None
    recolor: tuple[RecolorTable, ...] = ()
    """Colors of instances."""

    @property
    def lights(self) -> bool:
        """True if each setup has its own light."""
        return self.light is not None or self.sky is not None
