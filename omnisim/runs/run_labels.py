"""Labels of a run's images: the ground truth for the training of color histograms.

They come from the run's own channel `instance`, recorded by `omnisim drive ... --also instance`.
The scene's nodes are named after their landmark, `goal_yellow`; bands of a landmark with several
colors are also named after their color, `beacon_left_yellow_pink`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import RunError
from omnisim.ground_truth.label_names import Labels
from omnisim.ground_truth.stored_channels import StoredChannels
from omnisim.perception.landmarks.color_model import (
    VALIDATE_EVERY,
    Costs,
    LabeledPixels,
    Training,
    train_colors,
)
from omnisim.rendering.camera.omnicamera import IMAGE_SUFFIX
from omnisim.runs.run_data import RunData
from omnisim.runs.run_folder import LABELS
from omnisim.scene.model import Landmark

# Minimum saturation, (largest − smallest)/largest of linear RGB, of a landmark's color. It excludes
# white lines, walls and paper, which are everywhere.
MIN_SATURATION = 0.5
Track = Callable[[Iterable[int]], Iterable[int]]


def landmark_colors(landmarks: Sequence[Landmark]) -> tuple[str, ...]:
    """Names of the saturated colors of landmarks, in alphabetical order."""
    colors = set()
    for landmark in landmarks:
        for band in landmark.bands:
            brightest = max(band.linear_rgb)
            if brightest > 0.0 and 1.0 - min(band.linear_rgb) / brightest >= MIN_SATURATION:
                colors.add(band.color)
    return tuple(sorted(colors))


class RunLabels:
    """Classes of the pixels of a run's images.

    Args:
        run: run with the channel `instance`.
        colors: names of the landmark colors; their classes are 1, 2, ...

    Raises:
        RunError: the run lacks the channel, or its table of labels is damaged.
    """

    def __init__(self, run: RunData, colors: Sequence[str]):
        path = run.folder.path
        if "instance" not in run.folder.manifest.channels:
            raise RunError(
                f"{path}: has no labels to learn from: drive it again into a new folder with "
                "--also instance"
            )
        self._run = run
        self._class_of_instance = _class_of_instance(run, colors)

    def __call__(self, step: int) -> NDArray[np.uint8]:
        """Class of each pixel (height, width): 0, or 1 + the index of a color.

        Raises:
            RunError: the step's file has unknown instances.
            OutputError: the file is missing or damaged.
        """
        image = self._run.folder.file(self._run.camera, step, IMAGE_SUFFIX)
        ids: NDArray[np.uint32]
        ids = StoredChannels(image, {}).read(["instance"])["instance"]
        if ids.max(initial=0) >= len(self._class_of_instance):
            raise RunError(f"{image}: its channel has instances that are not in {LABELS}")
        return self._class_of_instance[ids]

    def pixels(self, track: Track = iter) -> Iterator[LabeledPixels]:
        """Pixels (n, 3) that show the scene, and their classes (n,), image by image.

        Args:
            track: wrapper of the steps, for progress.
        """
        covered = self._run.mount.covered
        selected = slice(None) if covered is None else covered.ravel()
        for step in track(range(self._run.steps)):
            yield self._run.image(step).reshape(-1, 3)[selected], self(step).ravel()[selected]


def train_on_run(run: RunData, costs: Costs, track: Track = iter) -> Training:
    """Train a color model on a run's landmarks.

    Args:
        run: run with the channel `instance`.
        costs: costs of misclassification.
        track: wrapper of the steps, for progress.

    Raises:
        RunError: a run without labels, or with too few images.
        LocalizationError: a color is visible in no image.
    """
    colors = landmark_colors(run.landmarks)
    labels = RunLabels(run, colors)
    if run.steps < VALIDATE_EVERY:
        raise RunError(
            f"{run.folder.path}: expected at least {VALIDATE_EVERY} images to train on some and "
            f"choose Θ by others, got {run.steps}"
        )
    return train_colors(colors, labels.pixels(track), costs)


def _class_of_instance(run: RunData, colors: Sequence[str]) -> NDArray[np.uint8]:
    """Classes (n,) by instance ID."""
    path = run.folder.path / LABELS
    classes = {
        name: index
        for landmark in run.landmarks
        for band in landmark.bands
        for index, color in enumerate(colors, start=1)
        if color == band.color
        for name in _node_names(landmark, color)
    }
    try:
        labels = Labels.from_json(json.loads(path.read_text(encoding="utf-8")))
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except (KeyError, TypeError, ValueError, RecursionError):
        raise RunError(f"{path}: is damaged: not a table of labels") from None
    # objects that move with the vehicle are no landmarks, whatever their names
    fixed = (0 if one.object_name else classes.get(one.name, 0) for one in labels.instances)
    return np.array([0, *fixed], dtype=np.uint8)


def _node_names(landmark: Landmark, color: str) -> tuple[str, ...]:
    if len(landmark.bands) == 1:
        return (landmark.name, f"{landmark.name}_{color}")
    return (f"{landmark.name}_{color}",)
