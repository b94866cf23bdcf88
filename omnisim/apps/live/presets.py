"""Presets: cameras of the gallery and optical systems of the examples.

`make gallery` writes their parameters to `presets.json`.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from omnisim.apps.live.camera_document import SENSOR, CameraDocument
from omnisim.cameras.optics.system_file import AlignmentTable
from omnisim.core.errors import OutputError, did_you_mean
from omnisim.rendering.camera.degradations import preset_names

PRESETS_FILE = Path(__file__).with_name("presets.json")
PAPER, HYPERBOLIC = "paper", "hyperbolic"  # the same camera
KINDS = ("lens", "optics", "degradation")
OPTICS_CAMERA = f"{SENSOR}.optics.camera"  # table of an optical system's camera
MODEL_PATHS = (f"{SENSOR}.lens.model", f"{OPTICS_CAMERA}.model")


@cache
def _presets() -> dict[str, dict[str, Any]]:
    return json.loads(PRESETS_FILE.read_text(encoding="utf-8"))


def preset_lists() -> dict[str, list[str]]:
    """Names of the presets, by kind; lenses in the order of the images in page/lenses.jpg."""
    read = _presets()
    return {
        "lens": [PAPER if name == HYPERBOLIC else name for name in read["lens"]],
        "optics": list(read["optics"]),
        "degradation": preset_names(),
    }


def with_preset(document: CameraDocument, kind: str, name: str) -> CameraDocument:
    """Copy of a document with the camera, optical system or degradations of a preset.

    Raises:
        OutputError: no such kind or preset.
    """
    names = preset_lists().get(kind)
    if names is None:
        raise OutputError(f"preset {kind!r}: {did_you_mean(kind, KINDS)}")
    if name not in names:
        raise OutputError(f"preset {name!r}: {did_you_mean(name, names)}")
    if kind == "degradation":
        return document.with_degradation(name)
    if name == PAPER:
        return document.with_mirror()
    table = _presets()[kind][name]
    return document.with_optics(table) if kind == "optics" else document.with_lens(table)


def with_model(document: CameraDocument, path: str, model: Any) -> CameraDocument:
    """Copy of a document with the preset of another camera model.

    Args:
        document: document to copy.
        path: path of the key `model`, of a lens or of an optical system's camera, which stays
            where it is behind the surfaces.
        model: name of the model.

    Raises:
        OutputError: no such model.
    """
    name = PAPER if model == HYPERBOLIC else str(model)
    table = path.rpartition(".")[0]
    if table != OPTICS_CAMERA:
        return with_preset(document, "lens", name)
    lenses = _presets()["lens"]
    if str(model) not in lenses:
        raise OutputError(f"{path}: {did_you_mean(str(model), list(lenses))}")
    own = document.value(table) or {}
    placed = {key: own[key] for key in AlignmentTable.model_fields if key in own}
    return document.with_value(table, {**lenses[str(model)], **placed})
