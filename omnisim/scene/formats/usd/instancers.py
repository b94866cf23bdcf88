"""Point instancers: prototypes at many poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from omnisim.core.errors import SceneError
from omnisim.scene.formats.usd.primvars import integers


class Copies(NamedTuple):
    """Copies of a prototype.

    Attributes:
        prototype: root prim of the prototype.
        numbers: (n,) indices of the copies within the instancer.
        instancer_from_copies: (n, 4, 4) transforms.
    """

    prototype: Usd.Prim
    numbers: NDArray[np.int64]
    instancer_from_copies: NDArray[np.float64]


def read_copies(instancer: UsdGeom.PointInstancer, time: Usd.TimeCode) -> list[Copies]:
    """Visible copies of each prototype of an instancer.

    Raises:
        SceneError: invalid prototype indices, or numbers of poses that do not match.
    """
    prim = instancer.GetPrim()
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    rows = integers(instancer.GetProtoIndicesAttr().Get(time))
    if not len(rows):
        return []
    if rows.min() < 0 or rows.max() >= len(targets):
        raise SceneError(
            f"{prim.GetPath()}.protoIndices: expected numbers below {len(targets)}, as there are "
            f"prototypes, got {rows.max() if rows.min() >= 0 else rows.min()}"
        )
    poses = instancer.ComputeInstanceTransformsAtTime(
        time, time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    )
    # usd-core's matrices multiply row vectors
    matrices = np.array(poses, dtype=np.float64).reshape(-1, 4, 4).swapaxes(1, 2)
    if len(matrices) != len(rows):
        raise SceneError(
            f"{prim.GetPath()}: expected as many positions, orientations and scales as "
            f"protoIndices, {len(rows)}"
        )
    visible = np.array(instancer.ComputeMaskAtTime(time) or np.ones(len(rows)), dtype=bool)
    copies = []
    for row, target in enumerate(targets):
        prototype = prim.GetStage().GetPrimAtPath(target)
        chosen = np.flatnonzero((rows == row) & visible)
        if prototype and len(chosen):
            copies.append(Copies(prototype, chosen, matrices[chosen]))
    return copies
