"""A stage some of whose materials are shown as they are, without light: lamps, screens."""

from __future__ import annotations

from dataclasses import dataclass

from scenes.modelling.stage import Stage

EXTENSION = "KHR_materials_unlit"


@dataclass
class GlowingStage(Stage):
    """A stage with materials that need no light."""

    glowing: tuple[str, ...] = ()

    def _finish_tree(self, tree: dict) -> None:
        super()._finish_tree(tree)
        for material in tree["materials"]:
            if material["name"] in self.glowing:
                material.setdefault("extensions", {})[EXTENSION] = {}
        tree.setdefault("extensionsUsed", []).append(EXTENSION)
