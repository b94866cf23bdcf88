"""Parameters of the filter, from a TOML file. `default.toml` explains each.

The paper does not publish any of them: all values are our choices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from omnisim.core.errors import LocalizationError
from omnisim.core.files.parameters import Number, Parameters
from omnisim.core.files.toml_file import read_toml

DEFAULT = Path(__file__).with_name("default.toml")

# Beyond any sensible value, and far below the overflow of a float's square.
_MAX_NUMBER = 1e12
NotNegative = Annotated[Number, Field(ge=0.0, le=_MAX_NUMBER)]
Positive = Annotated[Number, Field(gt=0.0, le=_MAX_NUMBER)]


@dataclass(frozen=True, kw_only=True)
class StartNoise(Parameters, name="start"):
    """Standard deviations of the first pose."""

    position_sigma_m: NotNegative
    """Standard deviation of x and of y in meters; 0: known exactly."""
    heading_sigma_rad: NotNegative
    """Standard deviation of the heading in degrees; 0: known exactly."""


@dataclass(frozen=True, kw_only=True)
class MotionNoise(Parameters, name="motion"):
    """Noise of the wheels.

    The error from white noise grows with the square root of the distance, the error from systematic
    errors with the distance. A filter with three states cannot estimate systematic errors; it
    treats them as noise of each step.
    """

    distance_sigma_m_per_sqrt_m: NotNegative
    """Standard deviation of the distance after 1 m, meters."""
    distance_sigma_share: NotNegative
    """Standard deviation of a step's distance, as a share of the distance: wrong wheel size."""
    turn_sigma_rad_per_sqrt_m: NotNegative
    """Standard deviation of the heading after 1 m, degrees."""
    turn_sigma_rad_per_sqrt_rad: NotNegative
    """Standard deviation of the heading after a turn of 1 rad, degrees."""
    turn_sigma_rad_per_m: NotNegative
    """Standard deviation of the heading per meter driven, degrees: wheels of unequal size."""
    turn_sigma_share: NotNegative
    """Standard deviation of a step's turn, as a share of the turn: skidding wheels."""

    def sigmas(self, distance_m: float, turn_rad: float) -> tuple[float, float]:
        """Standard deviations of a step's distance in meters and its turn in radians."""
        driven, turned = abs(distance_m), abs(turn_rad)
        distance = math.hypot(
            self.distance_sigma_m_per_sqrt_m * math.sqrt(driven), self.distance_sigma_share * driven
        )
        turn = math.hypot(
            self.turn_sigma_rad_per_sqrt_m * math.sqrt(driven),
            self.turn_sigma_rad_per_sqrt_rad * math.sqrt(turned),
            self.turn_sigma_rad_per_m * driven,
            self.turn_sigma_share * turned,
        )
        return distance, turn


@dataclass(frozen=True, kw_only=True)
class MeasurementNoise(Parameters, name="measurement"):
    """Noise of an observation in addition to its own sigmas, and the validation gate."""

    range_sigma_share: NotNegative
    """Standard deviation as a share of the range: mirror, mounting, uneven floor."""
    range_sigma_m: NotNegative
    """Standard deviation of every range, meters."""
    bearing_sigma_rad: NotNegative
    """Standard deviation of every bearing, degrees."""
    relation: Literal["exact", "eq2"]
    """Relation between image radius and incidence: "exact", or "eq2" for the paper's Eq. 2."""
    gate: Positive
    """Maximum squared Mahalanobis distance; 9.21: 99 % of chi-square, 2 degrees of freedom."""
    report_after_steps: Annotated[int, Field(ge=1, strict=True)]
    """Successive steps without an accepted observation after which a notice is given."""


@dataclass(frozen=True, kw_only=True)
class FilterParameters(Parameters):
    """All parameters of the filter."""

    start: StartNoise
    motion: MotionNoise
    measurement: MeasurementNoise


def read_parameters(path: Path | None = None) -> FilterParameters:
    """Read a file of filter parameters; by default omnisim's own.

    Raises:
        LocalizationError: an invalid file; the message names file, key, value and expected value.
    """
    return read_toml(path or DEFAULT, FilterParameters, LocalizationError)
