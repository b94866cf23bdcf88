"""Traversal of a stage: visible prims, their poses, and the objects that contain them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Kind, Usd, UsdGeom, UsdShade

from omnisim.core.errors import SceneError
from omnisim.scene.formats.omissions import Omissions
from omnisim.scene.formats.usd.semantics import semantic_class

MAX_DEPTH = 500  # nesting depth of prims, which Sdf paths do not limit
_DRAWN = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


class ObjectFrame(NamedTuple):
    """Object that contains prims: a component, or a prim with a class.

    Attributes:
        name, path: name and path of the object's prim.
        stage_from_object: (4, 4) transform.
        class_name: semantic class; empty: none.
    """

    name: str
    path: str
    stage_from_object: NDArray[np.float64]
    class_name: str = ""


class Site(NamedTuple):
    """Prim with its inherited properties.

    Attributes:
        prim: the prim itself, or its proxy in an instance.
        stage_from_prim: (4, 4) transform.
        purpose: purpose of UsdGeomImageable.
        owner: object that contains the prim; None: no object.
    """

    prim: Usd.Prim
    stage_from_prim: NDArray[np.float64]
    purpose: str = UsdGeom.Tokens.default_
    owner: ObjectFrame | None = None

    @property
    def is_drawn(self) -> bool:
        """True for the purposes default and render."""
        return self.purpose in _DRAWN


class Walk:
    """Traversal of visible prims, parents before children, in stage order."""

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode, notices: Omissions):
        self._time, self._notices = time, notices
        self._children = Usd.TraverseInstanceProxies()
        default = stage.GetDefaultPrim()
        roots = stage.GetPseudoRoot().GetChildren()
        self._whole = default or (roots[0] if len(roots) == 1 else None)

    def sites(self, root: Usd.Prim, stage_from_parent: NDArray[np.float64]) -> Iterator[Site]:
        """Sites of a prim and its descendants, except those below a PointInstancer.

        Raises:
            SceneError: prims nested too deeply.
        """
        stack = [(Site(root, stage_from_parent), 0)]
        while stack:
            parent, depth = stack.pop()
            site = parent if parent.prim.IsPseudoRoot() else self._site(parent)
            if site is None:
                continue
            if depth > MAX_DEPTH:
                raise SceneError(f"{site.prim.GetPath()}: expected at most {MAX_DEPTH} levels")
            yield site
            if site.prim.IsA(UsdGeom.PointInstancer) or site.prim.IsA(UsdShade.Material):
                continue
            children = site.prim.GetFilteredChildren(self._children)
            stack += [(site._replace(prim=child), depth + 1) for child in reversed(children)]

    def path_name(self, prim: Usd.Prim) -> str:
        """Path of a prim, relative to the prim that contains the whole stage."""
        path = prim.GetPath()
        if self._whole and path != self._whole.GetPath() and path.HasPrefix(self._whole.GetPath()):
            return str(path.MakeRelativePath(self._whole.GetPath()))
        return str(path).lstrip("/")

    def _site(self, inherited: Site) -> Site | None:
        """Site of a prim, from its parent's pose, purpose and object; None: invisible."""
        prim, owner = inherited.prim, inherited.owner
        imageable = UsdGeom.Imageable(prim)
        if not imageable:
            return inherited
        if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
            self._notices.count("invisible prims are not drawn")
            return None
        purpose = imageable.GetPurposeAttr()
        matrix = self._stage_from_prim(prim, inherited.stage_from_prim)
        class_name = semantic_class(prim, self._time)
        if class_name or (owner is None and prim != self._whole and _is_component(prim)):
            owner = ObjectFrame(prim.GetName(), str(prim.GetPath()), matrix, class_name or "")
        return Site(
            prim,
            matrix,
            str(purpose.Get()) if purpose.HasAuthoredValue() else inherited.purpose,
            owner,
        )

    def _stage_from_prim(
        self, prim: Usd.Prim, stage_from_parent: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        form = UsdGeom.Xformable(prim)
        if not form:
            return stage_from_parent
        # usd-core's matrices multiply row vectors
        parent_from_prim = np.array(form.GetLocalTransformation(self._time)).T
        if form.TransformMightBeTimeVarying():
            self._notices.count("animation: rests at its first frame")
        with np.errstate(all="ignore"):
            if form.GetResetXformStack():
                return parent_from_prim
            product: NDArray[np.float64] = stage_from_parent @ parent_from_prim
            return product


def _is_component(prim: Usd.Prim) -> bool:
    kind = Usd.ModelAPI(prim).GetKind()
    return bool(kind) and Kind.Registry.IsA(kind, Kind.Tokens.component)
