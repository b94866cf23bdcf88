"""File of a color model and its landmarks: `.npz`.

It holds `counts` (1 + colors, 32³), `colors`, `thresholds`, `smoothing`, and `landmarks` as JSON,
so that detection needs no scene; nothing in it is pickled.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np

from omnisim.core.errors import LocalizationError
from omnisim.core.files.atomic_file import atomic_write, check_suffix
from omnisim.core.files.npz_file import read_arrays
from omnisim.core.files.parameters import Table, parse_table
from omnisim.perception.landmarks.color_model import ColorModel
from omnisim.scene.model import Landmark

FORMAT = 1
SUFFIX = ".npz"
_EXPECTED = "expected the .npz file of omnisim landmarks train"
_NO_MODEL = (KeyError, TypeError, ValueError, OverflowError, AttributeError, RecursionError)


class _StoredLandmarks(Table):
    landmarks: tuple[Landmark, ...]


def save_model(path: Path, model: ColorModel, landmarks: tuple[Landmark, ...]) -> None:
    """Write a model and its landmarks; atomically.

    Raises:
        OutputError: another suffix, or the file cannot be written.
    """
    check_suffix(path, SUFFIX)
    encoded = json.dumps([dataclasses.asdict(landmark) for landmark in landmarks])
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.savez_compressed(
            file,
            format=FORMAT,
            counts=model.counts.astype(np.uint32),
            colors=np.array(model.colors),
            thresholds=np.array(model.thresholds),
            smoothing=model.smoothing,
            landmarks=encoded,
        )


def load_model(path: Path) -> tuple[ColorModel, tuple[Landmark, ...]]:
    """Read a model and its landmarks.

    Raises:
        LocalizationError: the file does not exist, or is not a color model.
    """
    stored = read_arrays(path, LocalizationError, "model", _EXPECTED)
    try:
        if int(stored["format"]) != FORMAT:
            raise LocalizationError(
                f"{path}: format = {int(stored['format'])}: expected {FORMAT}: train it again"
            )
        model = ColorModel(
            tuple(str(name) for name in stored["colors"]),
            stored["counts"].astype(np.float64),
            tuple(float(theta) for theta in stored["thresholds"]),
            float(stored["smoothing"]),
        )
        landmarks = _landmarks(json.loads(str(stored["landmarks"])))
    except _NO_MODEL:
        raise LocalizationError(f"{path}: is no model: {_EXPECTED}") from None
    except LocalizationError as reason:
        message = str(reason)
        raise LocalizationError(message if str(path) in message else f"{path}: {message}") from None
    return model, landmarks


def _landmarks(content: object) -> tuple[Landmark, ...]:
    try:
        stored = parse_table({"landmarks": content}, _StoredLandmarks, LocalizationError, "it")
    except LocalizationError as faults:  # one is enough: such files are not edited by hand
        first = str(faults).partition("\n")[0].removeprefix("it: ")
        raise LocalizationError(f"{first}: train it again") from None
    return stored.landmarks
