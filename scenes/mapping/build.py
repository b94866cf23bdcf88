"""Build mapping.glb: python -m scenes.mapping.build.

World axes: x east, y north, z up, meters; the origin is where the known start poses put it.
The same code always writes the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenes.mapping.doorways import fill_openings
from scenes.mapping.furnish import furnish
from scenes.mapping.interior import Interior
from scenes.mapping.materials import EMISSIVE, make_materials
from scenes.mapping.outside import doorstep, surround
from scenes.mapping.shell import build_shell
from scenes.modeling.geometry import pose
from scenes.modeling.stage import Stage

SEED = 250
OUTPUT = Path(__file__).with_name("mapping.glb")


def main() -> None:
    """Build the scene and print its size."""
    rng = np.random.default_rng(SEED)
    materials, atlas = make_materials(rng)
    stage = Stage("mapping", materials, emissive=EMISSIVE, is_matte=True)
    build_shell(stage, atlas)
    fill_openings(stage, atlas, rng)
    furnish(Interior(stage, atlas, rng))
    surround(stage, atlas, rng)
    stage.place("doorstep", doorstep(), pose(3.0, -10.0))
    size = stage.write(OUTPUT)
    print(
        f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles, "
        f"{len(stage.nodes)} nodes, {len(stage.models)} meshes"
    )


if __name__ == "__main__":
    main()
