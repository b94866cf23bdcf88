"""Opening of USD stages, with usd-core's errors as one-line messages."""

from __future__ import annotations

import re
from pathlib import Path

from pxr import Tf, Usd, UsdGeom

from omnisim.core.errors import SceneError
from omnisim.scene.files.file_axes import FileAxes
from omnisim.scene.formats.omissions import Omissions


def open_stage(path: Path, notices: Omissions) -> Usd.Stage:
    """Open a stage with all payloads; missing references become notices.

    Raises:
        SceneError: a damaged file, or one that is not a stage.
    """
    try:
        stage = Usd.Stage.Open(str(path.resolve()), Usd.Stage.LoadAll)
    except Tf.ErrorException as reason:
        raise SceneError(f"cannot be read as USD: {_first_line(reason, path)}") from None
    for error in stage.GetCompositionErrors():
        text = _relative(str(error), path)
        if ".mtlx" in text:
            notices.count("files of MaterialX are not read", "reference")
        else:
            notices.add(f"{text}: drawn without it")
    return stage


def stage_axes(stage: Usd.Stage) -> FileAxes:
    """Up axis and unit of a stage; the defaults are y and centimeters.

    Raises:
        SceneError: an invalid unit.
    """
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    if not 0.0 < unit < 1e30:
        raise SceneError(f"metersPerUnit = {unit:g}: expected a number > 0")
    return FileAxes(str(UsdGeom.GetStageUpAxis(stage)).lower(), unit)


def first_time(stage: Usd.Stage) -> Usd.TimeCode:
    """Time of the stage's first frame, or else the earliest time of each attribute."""
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def _first_line(reason: Tf.ErrorException, path: Path) -> str:
    """Error on one line, without the stage's path, which the message names already."""
    texts = [" ".join(str(error.commentary).split()) for error in reason.args]
    text = next((text for text in texts if not text.startswith("Failed to open layer")), "")
    return _relative(text, path) or "is damaged, or of another format than its name says"


def _relative(text: str, path: Path) -> str:
    """Message on one line, with paths relative to the stage's folder."""
    return re.sub(re.escape(f"{path.resolve().parent}/"), "", " ".join(text.split()))
