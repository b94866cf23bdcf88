"""Parameters of `omnisim bake`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import ResourcesOption, SceneArgument, UnitOption, UpOption
from omnisim.rendering.baking.settings import DEFAULT_BOUNCES, DEFAULT_SAMPLES


@dataclass(frozen=True)
class BakeRequest:
    """Parameters of `omnisim bake`."""

    scene: SceneArgument
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR",
            help="New or empty folder; a bake that was stopped resumes where it was.",
        ),
    ] = None  # fmt: skip
    texel_m: Annotated[
        float | None,
        typer.Option(
            "--texel-m", metavar="M", min=1e-4, max=100.0,
            help="Width of a texel near the starts and paths; farther away they are coarser.",
            show_default="by the scene's area, for minutes",
        ),
    ] = None  # fmt: skip
    samples: Annotated[
        int,
        typer.Option("--samples", metavar="N", min=1, max=65536, help="Rays from each texel."),
    ] = DEFAULT_SAMPLES
    bounces: Annotated[
        int,
        typer.Option(
            "--bounces", metavar="N", min=0, max=1000,
            help="Reflections between lamps and texels; 0: direct light alone.",
        ),
    ] = DEFAULT_BOUNCES  # fmt: skip
    seed: Annotated[
        int,
        typer.Option("--seed", metavar="N", min=0, max=2**63 - 1, help="Seed of the rays."),
    ] = 0
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", metavar="N", min=1, max=1024,
            help="Threads; the files do not depend on them.", show_default="one for each core",
        ),
    ] = None  # fmt: skip
    force: Annotated[bool, typer.Option("--force", help="Replace the bake that is there.")] = False
    estimate: Annotated[
        bool,
        typer.Option("--estimate", help="Only say about how long it takes, and how large it is."),
    ] = False
    up_axis: UpOption = None
    meters_per_unit: UnitOption = None
    resources: ResourcesOption = None
