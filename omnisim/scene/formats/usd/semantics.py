"""Semantic classes of prims: UsdSemantics, and Omniverse's older schema."""

from __future__ import annotations

from pxr import Usd

from omnisim.scene.formats.usd.primvars import texts

_LABELS = "semantics:labels:"
_TAXONOMIES = ("class", "category")  # in order of preference
_OLDER_TYPE, _OLDER_DATA = ":params:semanticType", ":params:semanticData"


def semantic_class(prim: Usd.Prim, time: Usd.TimeCode) -> str | None:
    """Class stated by a prim itself; None: no class."""
    names = [name for name in prim.GetAppliedSchemas() if name.startswith("Semantics")]
    if not names:
        return None
    for taxonomy in _TAXONOMIES:
        labels = prim.GetAttribute(_LABELS + taxonomy)
        values = texts(labels.Get(time)) if labels else []
        if values:
            return values[0]
    for name in names:
        prefix = "semantic:" + name.partition(":")[2]
        kind, data = (prim.GetAttribute(prefix + end) for end in (_OLDER_TYPE, _OLDER_DATA))
        if kind and data and kind.Get(time) == "class" and data.Get(time):
            return str(data.Get(time))
    return None
