"""Requests of the commands for scenes and their baked light."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from omnisim.apps.cli.option_groups import SceneOptions
from omnisim.apps.cli.options import Option
from omnisim.rendering.baking.settings import DEFAULT_BOUNCES, DEFAULT_SAMPLES


@dataclass(frozen=True, kw_only=True)
class SceneRequest:
    """Parameters of `omnisim scene show`."""

    world: SceneOptions
    plot: Path | None = None
    """Also plot the scene from above: .png .pdf .svg."""
    json: bool = False
    """Print only JSON, with all instances."""
    all: bool = False
    """List all instances, not only the largest."""
    labels: Annotated[Path | None, Option(default="the scene's own labels")] = None
    """Label file: .toml."""


@dataclass(frozen=True, kw_only=True)
class SceneConvertRequest:
    """Parameters of `omnisim scene convert`."""

    world: SceneOptions
    output: Path
    """File to write: .glb."""


@dataclass(frozen=True, kw_only=True)
class BakeRequest:
    """Parameters of `omnisim bake`."""

    world: SceneOptions
    output: Annotated[Path | None, Option(metavar="DIR")] = None
    """New or empty folder; an interrupted bake in it resumes."""
    texel_m: Annotated[
        float | None,
        Option(
            flags=("--texel-m",), min=1e-4, max=100.0, default="by the scene's area, for minutes"
        ),
    ] = None
    """Width of a texel near the starts and paths; distant texels are coarser."""
    samples: Annotated[int, Option(min=1, max=65536)] = DEFAULT_SAMPLES
    """Number of rays per texel."""
    bounces: Annotated[int, Option(min=0, max=1000)] = DEFAULT_BOUNCES
    """Number of light bounces between surfaces; 0: direct light only."""
    seed: Annotated[int, Option(min=0, max=2**63 - 1)] = 0
    """Seed of the rays."""
    jobs: Annotated[int | None, Option(min=1, max=1024, default="one per core")] = None
    """Number of threads; the files do not depend on it."""
    force: bool = False
    """Overwrite an existing bake in the folder."""
    estimate: bool = False
    """Only estimate the baking time and the size."""
