"""Submesh names of COLLADA files, as Gazebo assigns them.

Gazebo names a submesh after the node that instantiates it. An unnamed node takes the name of its
nearest named ancestor, or else `unnamed_submesh_N`.

Source: gz-common, graphics/src/ColladaLoader.cc, `LoadNode`.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from typing import Any

import collada  # type: ignore[import-untyped]
from trimesh.util import unique_name

# Faults that trimesh tolerates, and so does this module.
_TOLERATED = [
    collada.common.DaeError,
    collada.common.DaeIncompleteError,
    collada.common.DaeMalformedError,
    collada.common.DaeBrokenRefError,
    collada.common.DaeUnsupportedError,
]
_SURFACES = (collada.polylist.Polylist, collada.triangleset.TriangleSet)


def submesh_names(data: bytes) -> dict[str, tuple[str, str]]:
    """Names of submeshes and of their geometries, keyed by trimesh's mesh names."""
    names: dict[str, tuple[str, str]] = {}
    counts: dict[str | None, int] = {}
    unnamed = (f"unnamed_submesh_{number}" for number in itertools.count())
    for root in collada.Collada(io.BytesIO(data), ignore=_TOLERATED).scene.nodes:
        for geometry, owner in _instances(root, "", unnamed):
            for primitive in geometry.primitives:
                if isinstance(primitive, _SURFACES) and primitive.vertex is not None:
                    mesh = unique_name(geometry.id, contains=names, counts=counts)
                    names[mesh] = owner, geometry.id
    return names


def _instances(node: Any, ancestor: str, unnamed: Iterator[str]) -> Iterator[tuple[Any, str]]:
    """Geometries below a node in file order, each with the name of its node."""
    if isinstance(node, collada.scene.GeometryNode):
        yield node.geometry, ancestor
    if not isinstance(node, collada.scene.Node):
        return
    target = getattr(node, "node", node)  # the target, if this is an instance of a node
    name = target.xmlnode.get("name") or ancestor
    below = [
        list(_instances(child, name, unnamed))
        for child in node.children or ()
        if isinstance(child, collada.scene.Node)
    ]
    if not name and any(isinstance(one, collada.scene.GeometryNode) for one in node.children):
        name = next(unnamed)
    nested = iter(below)
    for child in node.children or ():
        if isinstance(child, collada.scene.Node):
            yield from next(nested)
        else:
            yield from _instances(child, name, unnamed)
