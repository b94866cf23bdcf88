"""Requests of the commands for scenes and their baked light."""

from pathlib import Path
from typing import Annotated

from omnisim.apps.cli.option_groups import SceneOptions
from omnisim.apps.cli.options import OWN, Option, command, of

_BAKE = "rendering.baking.settings.BakeSettings"


@command("scene show", "worlds.scene.show")
class SceneRequest:
    """Summarize a scene: instances, bounds, floors, starts, paths, lights, classes.

    omnisim scene soccer
    omnisim scene room.glb --plot room.png
    """

    world: SceneOptions
    plot: Path | None = None
    """Also plot the scene from above: .png .pdf .svg."""
    json: bool = False
    """Print only JSON, with all instances."""
    all: bool = False
    """List all instances, not only the largest."""
    labels: Path | None = None
    """Label file: .toml. Default: the scene's own labels."""


@command("scene convert", "worlds.scene.convert")
class SceneConvertRequest:
    """Write a scene of any format as GLB: instances, materials, textures, lights.

    omnisim scene convert world.sdf -o world.glb
    omnisim scene convert room.obj --up y --meters-per-unit 0.01 -o room.glb
    """

    world: SceneOptions
    output: Path
    """File to write: .glb."""


@command("bake", "worlds.scene.bake")
class BakeRequest:
    """Bake a scene's light: shadows, sky and bounces on all static surfaces.

    omnisim bake courtyard --estimate
    omnisim bake courtyard --samples 512 -o baked
    """

    world: SceneOptions
    output: Annotated[Path | None, Option(metavar="DIR")] = None
    """New or empty folder; an interrupted bake in it resumes."""
    texel_m: Annotated[float | None, of(_BAKE, flags=("--texel-m",))] = OWN
    samples: Annotated[int, of(_BAKE)] = OWN
    bounces: Annotated[int, of(_BAKE)] = OWN
    seed: Annotated[int, of(_BAKE)] = OWN
    jobs: Annotated[int | None, Option(ge=1, le=1024)] = None
    """Number of threads; the files do not depend on it. Default: one per core."""
    force: bool = False
    """Overwrite an existing bake in the folder."""
    estimate: bool = False
    """Only estimate the baking time and the size."""
