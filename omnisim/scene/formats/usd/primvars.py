"""Primvars of prims as NumPy arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from omnisim.scene.formats.usd.corners import PrimvarValues


def find_primvar(prim: Usd.Prim, name: str, width: int, time: Usd.TimeCode) -> PrimvarValues | None:
    """Own or inherited primvar of a prim; None: missing, or of another width."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    values = rows(primvar.Get(time), width)
    if values is None:
        return None
    indices = None
    if primvar.IsIndexed():
        stored = primvar.GetIndices(time)
        indices = np.array(() if stored is None else stored, dtype=np.int64).reshape(-1)
    return PrimvarValues(values, str(primvar.GetInterpolation()), indices)


def rows(value: object, width: int) -> NDArray[np.float64] | None:
    """Attribute value as rows (k, width); None: another type or width."""
    if value is None or isinstance(value, str):
        return None
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.size % width or array.ndim > 2:
        return None
    if array.ndim == 2 and array.shape[1] != width:
        return None
    with np.errstate(invalid="ignore"):
        return array.astype(np.float64).reshape(-1, width)


def integers(value: object) -> NDArray[np.int64]:
    """Integer array (k,) of an attribute; empty if missing or of another type."""
    array = np.asarray(value)
    return array.astype(np.int64).reshape(-1) if array.dtype.kind in "iu" else np.zeros(0, np.int64)


def texts(value: object) -> list[str]:
    """Strings of an array attribute; empty if missing."""
    return [str(each) for each in np.array(() if value is None else value).reshape(-1)]
