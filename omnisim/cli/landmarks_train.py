"""`omnisim landmarks train`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console

from omnisim.atomic_file import check_suffix, check_target
from omnisim.cli.options import counted
from omnisim.cli.progress import count_along
from omnisim.errors import LocalizationError
from omnisim.experiments.run_data import read_run
from omnisim.experiments.training import train_on_run
from omnisim.perception.color_model import Costs
from omnisim.perception.color_model_file import SUFFIX, save_model

# Past any that makes sense, and far from where a float ends.
LARGEST_COST = 1e9


def run(
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
    for name, cost in (("--missed", missed), ("--false-alarm", false_alarm)):
        if not 1.0 / LARGEST_COST <= cost <= LARGEST_COST:
            raise LocalizationError(
                f"{name} {cost:g}: want a number from {1.0 / LARGEST_COST:g} to {LARGEST_COST:g}"
            )
    check_suffix(output, SUFFIX)
    check_target(output)
    learned = read_run(folder, scene, camera)
    trained = train_on_run(
        learned,
        Costs(missed, false_alarm),
        lambda steps: count_along(steps, "learning", learned.steps, err),
    )
    if learned.unfinished:
        err.print("note: ", learned.unfinished, sep="", markup=False)
    save_model(output, trained.model, learned.landmarks)
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
