"""Interface that yields the ray hits behind ground truth."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits, ThroughHits
from omnisim.rendering.readback import Pending, ScenePoses
from omnisim.scene.model import Mesh


class DeformingDraw(NamedTuple):
    """Instance with a deforming mesh.

    Attributes:
        mesh: mesh and its deformation.
        object_index: index of its dynamic object; None: static.
        object_from_mesh: (4, 4), to the world or the dynamic object's frame.
    """

    mesh: Mesh
    object_index: int | None
    object_from_mesh: NDArray[np.float64]


class HitSource(ABC):
    """Casts the rays of a camera's pixels.

    Attributes:
        camera: camera model.
        polygons: number of polygons of the mirror's mesh; None: exact.
        draws: dynamic object and name of each instance, indexed by `Hits.draw_ids` − 1.
        has_ray: (height, width) false outside of the lens or the mirror.
        deforming: instances with deforming meshes, by index.
    """

    camera: CentralCamera
    polygons: int | None
    draws: Sequence[ObjectPart]
    has_ray: NDArray[np.bool_]
    deforming: Mapping[int, DeformingDraw]

    @abstractmethod
    def rays(self) -> NDArray[np.floating]:
        """Unit rays (height, width, 3), optical frame."""

    @abstractmethod
    def hits(self, poses: ScenePoses, details: HitDetails = NO_DETAILS) -> Hits:
        """Cast all rays."""

    def batch_hits(
        self, poses: Sequence[ScenePoses], details: HitDetails = NO_DETAILS
    ) -> Iterator[Hits]:
        """Cast all rays of each image, in order; by default one after the other."""
        for one in poses:
            yield self.hits(one, details)

    @abstractmethod
    def through(self, poses: ScenePoses, hits: Hits) -> ThroughHits:
        """Surfaces behind glass and after mirrors, given the first hits at the same poses.

        Raises:
            OmnisimError: the rays show glass or mirrors, and embreex is not installed.
        """

    @abstractmethod
    def begin_occlusion(
        self, other: ScenePoses, other_from_current: NDArray[np.float64], deformed: Hits | None
    ) -> Pending[NDArray[np.bool_]]:
        """Begin to find the points of the last `hits` that are occluded from another viewpoint.

        Args:
            other: poses at the other time.
            other_from_current: (draws, 3, 4) transforms of the instances' points, from the
                viewpoint frame of the last hits to that of the other time.
            deformed: last hits with the points of deformed surfaces; None: no surface deforms.

        Returns:
            Mask (height, width).
        """

    def objects_of_draws(self) -> NDArray[np.intp]:
        """Object of each instance (n + 1,), after −1 for no hit; 0: the static scene."""
        objects = [0 if index is None else index + 1 for index, _ in self.draws]
        return np.array([0, *objects], dtype=np.intp)
