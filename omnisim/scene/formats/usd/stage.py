"""Opening of USD stages, with usd-core's errors as one-line messages."""

from __future__ import annotations

import re
from pathlib import Path

from pxr import Tf, Usd, UsdGeom

from omnisim.core.errors import SceneError
from omnisim.scene.formats.features import Parts, feature_table
from omnisim.scene.formats.imported_scene import FileAxes, Omissions

_LIGHTS = ("SphereLight", "DiskLight", "RectLight", "CylinderLight", "DistantLight", "DomeLight")
_READ_TYPES = ("Mesh", "Camera", *_LIGHTS)  # types all of whose properties are looked at
_MAX_FAULT = 200  # characters of usd-core's message


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
    _compare_axes(stage, notices)
    return stage


def _compare_axes(stage: Usd.Stage, notices: Omissions) -> None:
    """Add a notice for each layer whose unit or up axis differs from the stage's.

    USD does not convert, and viewers do not either: a composed prim is in the stage's unit.
    """
    axes = ("metersPerUnit", UsdGeom.GetStageMetersPerUnit(stage)), (
        "upAxis", UsdGeom.GetStageUpAxis(stage)
    )  # fmt: skip
    for layer in stage.GetUsedLayers():
        root = layer.pseudoRoot
        others = [
            f"{key} = {root.GetInfo(key)} instead of {value}"
            for key, value in axes
            if layer.realPath and root.HasInfo(key) and root.GetInfo(key) != value
        ]
        if others:
            name = Path(layer.realPath).name
            notices.add(f"{name}: {', '.join(others)} of the stage: USD does not convert it")


def stage_axes(stage: Usd.Stage) -> FileAxes:
    """Up axis and unit of a stage; the defaults are y and centimeters.

    Raises:
        SceneError: an invalid unit.
    """
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    if not 0.0 < unit < 1e30:
        raise SceneError(f"metersPerUnit = {unit:g}: expected a number > 0")
    return FileAxes(str(UsdGeom.GetStageUpAxis(stage)).lower(), unit)


def stage_parts(stage: Usd.Stage, time: Usd.TimeCode) -> Parts:
    """Types and schemas of the prims of a stage and its prototypes, and properties of some."""
    known = {name for feature in feature_table("usd") for name in feature.names}
    roots = (stage.GetPseudoRoot(), *stage.GetPrototypes())
    for prim in (one for root in roots for one in Usd.PrimRange(root)):
        kind = str(prim.GetTypeName())
        names = [kind, *(one for one in prim.GetAppliedSchemas() if one in known)]
        yield from ((name, "") for name in names if name)
        for attribute in prim.GetAuthoredProperties():
            name = str(attribute.GetName())
            if name in known or (kind in _READ_TYPES and ":" not in name):
                is_value = isinstance(attribute, Usd.Attribute)
                yield name, str(attribute.Get(time)) if is_value else "targets"


def first_time(stage: Usd.Stage) -> Usd.TimeCode:
    """Time of the stage's first frame, or else the earliest time of each attribute."""
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def _first_line(reason: Tf.ErrorException, path: Path) -> str:
    """Error on one line, without the stage's path, which the message names already."""
    texts = [" ".join(str(error.commentary).split()) for error in reason.args]
    text = next((text for text in texts if not text.startswith("Failed to open layer")), "")
    text = re.sub(r"parse error matching .*?(?= at ')", "syntax error", text)  # types of its parser
    return (
        _relative(text, path)[:_MAX_FAULT] or "is damaged, or of another format than its name says"
    )


def _relative(text: str, path: Path) -> str:
    """Message on one line, with paths relative to the stage's folder."""
    return re.sub(re.escape(f"{path.resolve().parent}/"), "", " ".join(text.split()))
