"""Position and light of the sun, by time and place.

The accuracy is 0.01° between the years 1950 and 2050, without refraction, which raises the sun by
0.5° at the horizon and by 0.02° at 45°.
Source: Meeus, "Astronomical Algorithms", 2nd edition, 1998, chapters 12, 13, 22 and 25 (low
accuracy); light: IESNA, "The Lighting Handbook", 9th edition, 2000, chapter 8 (clear sky).
"""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
_CENTURY_DAYS = 36525.0
_OUTSIDE_LX = 127_500.0  # above the atmosphere, at the mean distance
_EXTINCTION = 0.21  # optical depth of a clear sky


class SunPosition(NamedTuple):
    """Direction toward the sun.

    Attributes:
        elevation_deg: elevation above the horizon; negative: below it.
        azimuth_deg: azimuth from north toward east.
    """

    elevation_deg: float
    azimuth_deg: float

    def direction(self, north_deg: float) -> NDArray[np.float64]:
        """Direction of travel (3,) of the sun's light, world frame.

        Args:
            north_deg: direction of north, counter-clockwise from the world's x.
        """
        height, yaw = math.radians(self.elevation_deg), math.radians(north_deg - self.azimuth_deg)
        across = math.cos(height)
        return -np.array([across * math.cos(yaw), across * math.sin(yaw), math.sin(height)])


def sun_position(time: datetime, latitude_deg: float, longitude_deg: float) -> SunPosition:
    """Direction of the sun at a time, as seen from a position on Earth.

    Args:
        time: time with its UTC offset.
        latitude_deg: latitude, positive in the north.
        longitude_deg: longitude, positive in the east.
    """
    days = (time - _J2000).total_seconds() / 86400.0
    longitude, obliquity = _ecliptic(days / _CENTURY_DAYS)
    ascension = math.atan2(math.cos(obliquity) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(obliquity) * math.sin(longitude))
    sidereal_deg = 280.46061837 + 360.98564736629 * days + longitude_deg
    hour = math.radians(sidereal_deg % 360.0) - ascension
    latitude = math.radians(latitude_deg)
    east = -math.cos(declination) * math.sin(hour)
    north = math.sin(declination) * math.cos(latitude)
    north -= math.cos(declination) * math.cos(hour) * math.sin(latitude)
    up = math.sin(declination) * math.sin(latitude)
    up += math.cos(declination) * math.cos(hour) * math.cos(latitude)
    return SunPosition(
        math.degrees(math.atan2(up, math.hypot(east, north))),
        math.degrees(math.atan2(east, north)) % 360.0,
    )


def sun_illuminance_lx(elevation_deg: float) -> float:
    """Illuminance, lx, of a surface that faces the sun in a clear sky; 0 below the horizon."""
    height = math.sin(math.radians(elevation_deg))
    return _OUTSIDE_LX * math.exp(-_EXTINCTION / height) if height > 0.0 else 0.0


def _ecliptic(centuries: float) -> tuple[float, float]:
    """Apparent solar longitude and obliquity of the ecliptic, rad, from centuries since J2000."""
    mean_deg = 280.46646 + centuries * (36000.76983 + 0.0003032 * centuries)
    anomaly = math.radians(357.52911 + centuries * (35999.05029 - 0.0001537 * centuries))
    center_deg = (1.914602 - centuries * (0.004817 + 0.000014 * centuries)) * math.sin(anomaly)
    center_deg += (0.019993 - 0.000101 * centuries) * math.sin(2.0 * anomaly)
    center_deg += 0.000289 * math.sin(3.0 * anomaly)
    node = math.radians(125.04 - 1934.136 * centuries)
    longitude_deg = mean_deg + center_deg - 0.00569 - 0.00478 * math.sin(node)
    obliquity_deg = 23.4392911 - 0.0130042 * centuries + 0.00256 * math.cos(node)
    return math.radians(longitude_deg), math.radians(obliquity_deg)
