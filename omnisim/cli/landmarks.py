"""`omnisim landmarks`: learn their colours, find them in pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnisim.cli.arguments import RunArgument
from omnisim.cli.consoles import err, out

landmarks_app = typer.Typer(
    name="landmarks", help="Learn the colours of landmarks, and find them.", no_args_is_help=True
)

ModelOption = Annotated[
    Path, typer.Option("--model", metavar="FILE", help="Model of `landmarks train`: .npz.")
]
SceneOption = Annotated[
    str | None, typer.Option("--scene", help="Its scene, where it is not where it was.")
]
CameraOption = Annotated[
    str | None, typer.Option("--camera", help="Name of a camera. [dim]the first[/]")
]


@landmarks_app.command("train")
def _train(
    run: RunArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="Model: .npz.")],
    missed: Annotated[
        float, typer.Option("--missed", help="Cost of a landmark's pixel that is missed.")
    ] = 1.0,
    false_alarm: Annotated[
        float, typer.Option("--false-alarm", help="Cost of another pixel taken for a landmark's.")
    ] = 4.0,
    scene: SceneOption = None,
    camera: CameraOption = None,
) -> None:
    """Learn the colours from a run that was driven with --also instance."""
    from omnisim.cli.landmarks_train import run as train

    train(run, output, missed, false_alarm, scene, camera, out, err)


@landmarks_app.command("detect")
def _detect(
    picture: Annotated[
        Path, typer.Argument(metavar="PICTURE|RUN", help="A picture of omnisim, or a run.")
    ],
    model: ModelOption,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Detections: .csv.")] = None,
    show: Annotated[
        Path | None,
        typer.Option("--show", metavar="FILE", help="Panoramas with them: .png .pdf .svg."),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            "--height",
            metavar="M",
            help="Of the viewpoint over the ground, for a picture. [dim]its own[/]",
        ),
    ] = None,
    scene: SceneOption = None,
    camera: CameraOption = None,
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor",
            metavar="FILE",
            help="Camera of a picture that says nothing of its own: .toml.",
        ),
    ] = None,
) -> None:
    """Find landmarks with range and bearing in a picture or in all pictures of a run."""
    from omnisim.cli.landmarks_detect import run as detect

    detect(picture, model, output, show, height, scene, camera, sensor, out, err)
