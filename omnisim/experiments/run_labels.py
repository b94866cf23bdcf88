"""Which pixels of a run's pictures are whose colour: the ground truth that histograms learn from.

It comes from the run's own channel `instance`, as `omnisim drive ... --also instance` records it:
the scenes' nodes are named after their landmark, `goal_yellow`, and where it has bands of several
colours also after those, `beacon_left_yellow_pink`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import RunError
from omnisim.experiments.run_data import RunData
from omnisim.image_files import read_channels
from omnisim.scene.model import Landmark
from omnisim.simulation.run_channels import LABELS
from omnisim.simulation.run_folder import CHANNELS_SUFFIX

# Least saturation, (largest − smallest)/largest of linear RGB, of a colour that tells something:
# white lines, walls and paper are everywhere.
LEAST_SATURATION = 0.5


def landmark_colors(landmarks: Sequence[Landmark]) -> tuple[str, ...]:
    """Names of the colours that landmarks are told by, in the order of the alphabet."""
    found = set()
    for landmark in landmarks:
        for band in landmark.bands:
            brightest = max(band.linear_rgb)
            if brightest > 0.0 and 1.0 - min(band.linear_rgb) / brightest >= LEAST_SATURATION:
                found.add(band.color)
    return tuple(sorted(found))


class RunLabels:
    """The labels of a run's pictures.

    Args:
        run: with the channel `instance`.
        colors: names of the landmark colours; their classes are 1, 2, ...

    Raises:
        RunError: the run has no such channel, or its table of labels is damaged.
    """

    def __init__(self, run: RunData, colors: Sequence[str]):
        path = run.folder.path
        if "instance" not in run.folder.manifest.get("channels", []):
            raise RunError(
                f"{path}: has no labels to learn from: drive it again into a new folder with "
                "--also instance"
            )
        self._run = run
        self._class_of_instance = _class_of_instance(run, colors)

    def __call__(self, step: int) -> NDArray[np.uint8]:
        """The class of each pixel (height, width): 0, or 1 + the index of a colour.

        Raises:
            RunError: the step's file has no instances.
            OutputError: it is missing or damaged.
        """
        path = self._run.folder.file(self._run.camera, step, CHANNELS_SUFFIX)
        layers = read_channels(path).values
        if "instance" not in layers:
            raise RunError(f"{path}: has no layer instance: want the file of drive --also instance")
        ids = np.asarray(layers["instance"]).astype(np.int64)
        if ids.min(initial=0) < 0 or ids.max(initial=0) >= len(self._class_of_instance):
            raise RunError(f"{path}: has instances that are not in {LABELS}")
        return self._class_of_instance[ids]


def _class_of_instance(run: RunData, colors: Sequence[str]) -> NDArray[np.uint8]:
    """The class (n,) of each number of an instance."""
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
        table = json.loads(path.read_text(encoding="utf-8"))["instances"]
        found = np.zeros(1 + max((int(entry["id"]) for entry in table), default=0), np.uint8)
        for entry in table:
            # what moves with the vehicle is no landmark, whatever its name
            if "object" not in entry:
                found[int(entry["id"])] = classes.get(str(entry["name"]), 0)
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except (KeyError, TypeError, ValueError, IndexError):
        raise RunError(f"{path}: is damaged: not a table of labels") from None
    return found


def _node_names(landmark: Landmark, color: str) -> tuple[str, ...]:
    if len(landmark.bands) == 1:
        return (landmark.name, f"{landmark.name}_{color}")
    return (f"{landmark.name}_{color}",)
