"""The arcade under construction: models are made once, objects are numbered by their kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from scenes.arcade.furniture import foliage, plant_pot
from scenes.arcade.materials import TILES
from scenes.modeling.geometry import Patch, tile
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model, Stage


class Display:
    """Everything that is on show."""

    def __init__(self, stage: Stage, atlas: Atlas, rng: np.random.Generator):
        self.stage, self.atlas, self.rng = stage, atlas, rng
        self._made: dict[tuple, Model] = {}
        self._count: Counter[str] = Counter()

    def made(self, maker: Callable[..., Model], *arguments) -> Model:
        """The model that `maker` makes of the atlas and the arguments, always the same one."""
        key = (maker, arguments)
        if key not in self._made:
            self._made[key] = maker(self.atlas, *arguments)
        return self._made[key]

    def put(self, kind: str, model: Model, at: np.ndarray) -> None:
        """Add one object; its name is its kind and a number."""
        self._count[kind] += 1
        self.stage.place(f"{kind}_{self._count[kind]:02}", model, at)

    def lay(self, name: str, material: str, patch: Patch, at: np.ndarray | None = None) -> None:
        """Add one object that occurs once, with its material's tiling."""
        if material in TILES:
            patch = tile(patch, TILES[material])
        self.stage.place(name, Model(name, material, patch), at)

    def plant(self, height_mm: int, at: np.ndarray) -> None:
        """Add a pot plant: its leaves and its pot."""
        self.put("plant", self.made(foliage, height_mm, 7), at)
        self.put("plant_pot", self.made(plant_pot, height_mm), at)
