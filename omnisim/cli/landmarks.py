"""`omnisim landmarks`: learn their colours, find them in pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track

from omnisim.atomic_file import check_target
from omnisim.cli.arguments import RunArgument
from omnisim.cli.consoles import err, out
from omnisim.cli.options import counted
from omnisim.errors import LocalizationError, OpticsError

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
) -> None:
    """Find landmarks with range and bearing in a picture or in all pictures of a run."""
    detect(picture, model, output, show, height, scene, camera, out, err)


def train(
    folder: Path,
    output: Path,
    missed: float,
    false_alarm: float,
    scene: str | None,
    camera: str | None,
    out: Console,
    err: Console,
) -> None:
    """Learn colours and write the model.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    from omnisim.experiments.run_data import read_run
    from omnisim.experiments.training import train_on_run
    from omnisim.perception.color_model import Costs
    from omnisim.perception.color_model_file import check_model_target, save_model

    for name, cost in (("--missed", missed), ("--false-alarm", false_alarm)):
        if not 0.0 < cost < float("inf"):
            raise LocalizationError(f"{name} {cost:g}: want a finite number above 0")
    check_model_target(output)
    check_target(output)
    run = read_run(folder, scene, camera)
    trained = train_on_run(run, Costs(missed, false_alarm), _progress("learning", run.steps, err))
    save_model(output, trained.model, run.landmarks)
    colors, pictures = len(trained.model.colors), counted(trained.pictures, "picture")
    out.print(f"{output}: {colors} colours from {pictures}", markup=False)
    for name, theta, curve, counts in zip(
        trained.model.colors,
        trained.model.thresholds,
        trained.curves,
        trained.model.counts[1:],
        strict=True,
    ):
        chosen = int(np.searchsorted(-curve.thresholds, -theta, side="right")) - 1
        hits, alarms = (
            (curve.true_positives[chosen], curve.false_positives[chosen])
            if chosen >= 0
            else (0.0, 0.0)
        )
        out.print(
            f"  {name}: {int(counts.sum())} pixels, Θ = {theta:.4g}: finds {100.0 * hits:.1f} % of "
            f"its pixels and {100.0 * alarms:.2g} % of others; area under ROC {curve.area:.4f}",
            markup=False,
        )


def detect(
    source: Path,
    model_path: Path,
    output: Path | None,
    show: Path | None,
    height_m: float | None,
    scene: str | None,
    camera: str | None,
    out: Console,
    err: Console,
) -> None:
    """Find landmarks; write them, draw them, and say how many there are.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    from omnisim.experiments.detecting import picture_source, run_source
    from omnisim.perception.color_model_file import load_model
    from omnisim.perception.detection_files import write_detections
    from omnisim.perception.landmark_detector import LandmarkDetector
    from omnisim.plots.detection_plots import detections_figure
    from omnisim.plots.plot_file import check_plot_target, write_plot

    if output is not None:
        check_target(output)
    if show is not None:
        check_plot_target(show)
    model, landmarks = load_model(model_path)
    is_run = source.is_dir()
    if is_run and height_m is not None:
        raise OpticsError("--height: is for a picture; a run says how high its camera is")
    told = run_source(source, scene, camera) if is_run else picture_source(source, height_m)
    detector = LandmarkDetector(model, landmarks, told.mount)
    shown = set(np.linspace(0, told.count - 1, min(told.count, 6)).round().astype(int).tolist())
    found, rows, empty = [], [], []
    for step in _progress("looking", told.count, err)(range(told.count)):
        panorama = detector.panorama(told.picture(step))
        detections = detector.find(panorama)
        found += [(step, detection) for detection in detections]
        if not detections:
            empty.append(step)
        if step in shown and show is not None:
            title = f"step {step}" if is_run else source.name
            rows.append((f"{title}: {counted(len(detections), 'landmark')}", panorama, detections))
    if output is not None:
        write_detections(output, found)
    if show is not None:
        write_plot(show, detections_figure(rows))
    where = output or show or source
    out.print(
        f"{where}: {counted(len(found), 'landmark')} in {counted(told.count, 'picture')}",
        markup=False,
    )
    if not is_run:
        for _, detection in found:
            out.print(
                f"  {detection.landmark}: {detection.range_m:.3f} ± {detection.range_sigma_m:.3f} m"
                f", {np.degrees(detection.bearing_rad):.2f} ± "
                f"{np.degrees(detection.bearing_sigma_rad):.2f}°",
                markup=False,
            )
    if empty and is_run:
        names = ", ".join(map(str, empty[:8])) + (", ..." if len(empty) > 8 else "")
        err.print(f"note: no landmark in {counted(len(empty), 'picture')}: {names}", markup=False)


def _progress(what: str, total: int, err: Console):
    """Something that counts along with steps on a terminal."""

    def along(steps: Iterable[int]) -> Iterator[int]:
        return track(
            steps, what, total=total, console=err, transient=True, disable=not err.is_terminal
        )

    return along
