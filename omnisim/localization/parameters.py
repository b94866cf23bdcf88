"""The filter's parameters, from a TOML file. `default.toml` beside this file has each with a word.

The paper publishes none of them: all values are our choices.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from omnisim.errors import LocalizationError
from omnisim.parameters import Number, Table
from omnisim.toml_file import read_toml

DEFAULT = Path(__file__).with_name("default.toml")

# Past anything that makes sense, and far from where a float's square ends.
_LARGEST = 1e12
NotNegative = Annotated[Number, Field(ge=0.0, le=_LARGEST)]
Positive = Annotated[Number, Field(gt=0.0, le=_LARGEST)]


class Start(Table):
    """How well the first pose is known: standard deviations."""

    position_sigma_m: NotNegative
    heading_sigma_deg: NotNegative


class Motion(Table):
    """How far the wheels may be off.

    Noise that forgets grows with the root of the way, errors that stay the same grow with the way
    itself: a filter of three states cannot know them, and takes them for noise of each step.
    """

    distance_sigma_m_per_sqrt_m: NotNegative
    distance_sigma_share: NotNegative
    turn_sigma_deg_per_sqrt_m: NotNegative
    turn_sigma_deg_per_sqrt_rad: NotNegative
    turn_sigma_deg_per_m: NotNegative
    turn_sigma_share: NotNegative

    def sigmas(self, distance_m: float, turn_rad: float) -> tuple[float, float]:
        """Standard deviations of a step's distance in metres and of its turn in radians."""
        driven, turned = abs(distance_m), abs(turn_rad)
        distance = math.hypot(
            self.distance_sigma_m_per_sqrt_m * math.sqrt(driven), self.distance_sigma_share * driven
        )
        turn = math.hypot(
            math.radians(self.turn_sigma_deg_per_sqrt_m) * math.sqrt(driven),
            math.radians(self.turn_sigma_deg_per_sqrt_rad) * math.sqrt(turned),
            math.radians(self.turn_sigma_deg_per_m) * driven,
            self.turn_sigma_share * turned,
        )
        return distance, turn


class Measurement(Table):
    """How far a sighting may be off beyond what it says of itself, and how it is judged."""

    range_sigma_share: NotNegative
    range_sigma_m: NotNegative
    bearing_sigma_deg: NotNegative
    relation: Literal["exact", "eq2"]
    gate: Positive
    report_after_steps: Annotated[int, Field(ge=1, strict=True)]


class FilterParameters(Table):
    """Everything that the filter is told, apart from wheels, sightings and landmarks."""

    start: Start
    motion: Motion
    measurement: Measurement


def read_parameters(path: Path | None = None) -> FilterParameters:
    """Read a file of parameters; by default omnisim's own.

    Raises:
        LocalizationError: naming file, key, value and what was wanted.
    """
    return read_toml(path or DEFAULT, FilterParameters, LocalizationError)
