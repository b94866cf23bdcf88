"""Scenes of the benchmarks."""

from __future__ import annotations

from pathlib import Path

from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from omnisim.scene import Scene, load_scene
from omnisim.scene.files.load import NO_BAKED_LIGHT, NO_SKY

# A real scene that was not made for omnisim; it is kept outside the project.
WAREHOUSE = Path(__file__).resolve().parents[2] / "shared" / "assets" / "small_warehouse.glb"
PAPERS_MAPS = ("soccer", "mapping")


def usual_scenes() -> tuple[str, ...]:
    """Names of the default scenes: the paper's two maps, and the warehouse if it is available."""
    return (*PAPERS_MAPS, *([str(WAREHOUSE)] if WAREHOUSE.is_file() else []))


def load_scenes(
    options: Options, choice: tuple[str, ...] | None = None, has_own_light: bool = True
) -> dict[str, Scene]:
    """Load scenes by short name: the requested ones, or a suite's own choice.

    Args:
        options: options with the requested scenes.
        choice: choice of the suite; None: the default scenes.
        has_own_light: True: keep the TOML's sky, sun and baked light; False: plain lamps only, as
            other renderers draw them.

    Raises:
        SceneError: a scene cannot be loaded.
        BenchmarkError: two scenes have the same name.
    """
    sky, baked = (None, None) if has_own_light else (NO_SKY, NO_BAKED_LIGHT)
    scenes: dict[str, Scene] = {}
    for source in options.scenes or (usual_scenes() if choice is None else choice):
        name = Path(source).stem
        if name in scenes:
            raise BenchmarkError(f"--scene: expected distinct names, got {name!r} twice")
        scenes[name] = load_scene(source, sky=sky, baked=baked)
    return scenes
