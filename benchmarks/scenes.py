"""Scenes of the benchmarks."""

from __future__ import annotations

from pathlib import Path

from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from omnisim.scene import Scene, load_scene

# A real scene that was not made for omnisim; it is kept outside the project.
WAREHOUSE = Path(__file__).resolve().parents[2] / "shared" / "assets" / "small_warehouse.glb"
PAPERS_MAPS = ("soccer", "mapping")


def usual_scenes() -> tuple[str, ...]:
    """The paper's two maps, and the warehouse where it is."""
    return (*PAPERS_MAPS, *([str(WAREHOUSE)] if WAREHOUSE.is_file() else []))


def load_scenes(options: Options, choice: tuple[str, ...] | None = None) -> dict[str, Scene]:
    """Scenes by a short name: those that are asked for, or a suite's own choice.

    Raises:
        SceneError: one that cannot be loaded.
        BenchmarkError: two of one name.
    """
    scenes: dict[str, Scene] = {}
    for source in options.scenes or (usual_scenes() if choice is None else choice):
        name = Path(source).stem
        if name in scenes:
            raise BenchmarkError(f"--scene: expected distinct names, got {name!r} twice")
        scenes[name] = load_scene(source)
    return scenes
