"""A colour model and the landmarks that it is for, in one `.npz` file.

It holds `counts` (1 + colours, 32³), `colors`, `thresholds`, `smoothing`, and `landmarks` as JSON,
so that a picture alone is enough to look for them; nothing in it is pickled.
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np

from omnisim.atomic_file import whole_file
from omnisim.errors import LocalizationError, OutputError
from omnisim.perception.color_model import ColorModel
from omnisim.scene.model import Band, Landmark

FORMAT = 1
SUFFIX = ".npz"


def check_model_target(path: Path) -> None:
    """Refuse a name that is not a model's.

    Raises:
        OutputError: another suffix.
    """
    if path.suffix.lower() != SUFFIX:
        raise OutputError(f"{path}: want a name that ends in {SUFFIX}")


def save_model(path: Path, model: ColorModel, landmarks: tuple[Landmark, ...]) -> None:
    """Write a model; the file appears only when it is whole.

    Raises:
        OutputError: another suffix, or it cannot be written.
    """
    check_model_target(path)
    told = json.dumps([dataclasses.asdict(landmark) for landmark in landmarks])
    with whole_file(path) as partial, partial.open("wb") as file:
        np.savez_compressed(
            file,
            format=FORMAT,
            counts=model.counts.astype(np.uint32),
            colors=np.array(model.colors),
            thresholds=np.array(model.thresholds),
            smoothing=model.smoothing,
            landmarks=told,
        )


def load_model(path: Path) -> tuple[ColorModel, tuple[Landmark, ...]]:
    """Read a model and its landmarks.

    Raises:
        LocalizationError: no such file, or it is no model.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            if int(stored["format"]) != FORMAT:
                raise LocalizationError(
                    f"{path}: format = {int(stored['format'])}: want {FORMAT}: train it again"
                )
            model = ColorModel(
                tuple(str(name) for name in stored["colors"]),
                stored["counts"].astype(np.float64),
                tuple(float(theta) for theta in stored["thresholds"]),
                float(stored["smoothing"]),
            )
            landmarks = tuple(_landmark(told) for told in json.loads(str(stored["landmarks"])))
    except OSError as reason:
        raise LocalizationError(
            f"{path}: cannot be read: {reason.strerror or 'not a model'}: want the .npz file of "
            "omnisim landmarks train"
        ) from None
    except (KeyError, TypeError, ValueError, EOFError, zipfile.BadZipFile):
        raise LocalizationError(
            f"{path}: is no model: want the .npz file of omnisim landmarks train"
        ) from None
    except LocalizationError as reason:
        told = str(reason)
        raise LocalizationError(told if str(path) in told else f"{path}: {told}") from None
    return model, landmarks


def _landmark(told: dict) -> Landmark:
    bands = tuple(
        Band(band["color"], tuple(band["linear_rgb"]), band["bottom_m"], band["top_m"])
        for band in told["bands"]
    )
    return Landmark(told["name"], tuple(told["position_m"]), tuple(told["footprint_m"]), bands)
