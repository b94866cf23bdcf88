"""What a check is given and what it finds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.frame import Frame
from omnisim.scene import Scene, load_scene
from omnisim.sensors import OmniCamera, Renderer, Stage

TEXTURED_SCENE = "courtyard"


@dataclass(frozen=True)
class Measure:
    """A number that was measured, and the bound that it is held to.

    Attributes:
        name: what was measured.
        value: the number.
        bound: the largest it may be, or the smallest with `at_least`.
        unit: of both; empty for none.
        at_least: the bound is a lower one.
    """

    name: str
    value: float
    bound: float
    unit: str = ""
    at_least: bool = False

    @property
    def passed(self) -> bool:
        """Whether the bound holds; never for NaN."""
        return self.value >= self.bound if self.at_least else self.value <= self.bound


@dataclass(frozen=True)
class Table:
    """Numbers side by side.

    Attributes:
        caption: what they are.
        columns: heading of each column.
        rows: as many cells each, as text.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A figure of the report.

    Attributes:
        name: stem of its file.
        figure: what it shows.
        caption: one sentence: what must be seen.
    """

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True)
class Findings:
    """What a check found.

    Attributes:
        sentence: what was compared with what, and what it shows.
        measures: numbers that have a bound.
        facts: numbers that have none, by name.
        tables, pictures: for the report.
    """

    sentence: str
    measures: tuple[Measure, ...]
    facts: dict[str, float] = field(default_factory=dict)
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all bounds hold."""
        return all(measure.passed for measure in self.measures)


@dataclass(frozen=True)
class Bench:
    """What the checks share.

    Attributes:
        device: EGL's number of the GPU, or None.
        is_quick: use the smaller of two sizes where there is a choice.
    """

    device: int | None = None
    is_quick: bool = False

    @cached_property
    def scene(self) -> Scene:
        """The textured scene that pictures are compared in."""
        return load_scene(TEXTURED_SCENE)

    @cached_property
    def viewpoint_m(self) -> tuple[float, float, float]:
        """From where it is seen."""
        return self.scene.start.position_m

    def take(
        self, scene: Scene | Stage, camera: OmniCamera, world_from_base: NDArray[np.float64]
    ) -> Frame:
        """One frame, plain base colours, with linear floats."""
        device = None if isinstance(scene, Stage) else self.device
        with Renderer(scene, camera, unlit=True, device=device) as renderer:
            return renderer.render(world_from_base, linear=True)


def largest(values: NDArray[np.float64]) -> float:
    """The largest absolute value; NaN for none, which no bound lets pass."""
    return float(np.abs(values).max()) if values.size else math.nan


def mean(values: NDArray[np.float64]) -> float:
    """The mean absolute value; NaN for none, which no bound lets pass."""
    return float(np.abs(values).mean()) if values.size else math.nan
