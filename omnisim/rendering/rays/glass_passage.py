"""Passage of rays through bodies of glass: their media and directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.caster import RayHits, Rays
from omnisim.rendering.rays.embree import NO_TRIANGLE
from omnisim.rendering.rays.geometry import Poses
from omnisim.rendering.rays.shading.glass import NO_MEDIUM
from omnisim.rendering.rays.shading.reflections import Paths
from omnisim.rendering.rays.shading.shading import Shading, View


class GlassPassage:
    """Follows rays (n,) through glass, surface by surface.

    Args:
        shading: appearance of the surfaces.
        paths: (n,) paths of the rays.
        world_from_objects: poses of the dynamic objects.

    Attributes:
        sides: (surfaces,) mask of glass, whose back is hit from inside.
        paths: (n,) paths, in the media that their rays are in.
    """

    def __init__(self, shading: Shading, paths: Paths, world_from_objects: Poses):
        self._shading, self._poses = shading, world_from_objects
        air = np.full(len(paths.pixels), NO_MEDIUM, dtype=np.int32)
        self._media = air if paths.media is None else paths.media.copy()
        self.sides, self.paths = shading.is_glass, paths._replace(media=self._media)

    def attenuation(
        self, indices: NDArray[np.intp], rays: Rays, hits: RayHits
    ) -> NDArray[np.float32]:
        """Attenuation (m, 3) of light by glass before the hits of rays at indices (m,)."""
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        media = self._media[indices]
        media[hit] = self._shading.media(hits.take(hit), media[hit], self._poses)
        self._media[indices] = media
        return self._shading.glass.attenuation(media, hits.ranges_m - rays.near_m)

    def refract(
        self,
        indices: NDArray[np.intp],
        view: View,
        colors: NDArray[np.float32],
        opacity: NDArray[np.float32],
    ) -> tuple[Rays, NDArray[np.float32]]:
        """Rays behind their hits, and transmitted shares (m, 3); 0 at all surfaces but glass.

        Args:
            indices: (m,) indices of the rays.
            view: rays (m,) and their hits; all rays must hit.
            colors: (m, 3 or more) base colors.
            opacity: (m,) opacity of the surfaces; 0: holes, which refract nothing.
        """
        shares = np.zeros((len(indices), 3), dtype=np.float32)
        is_glass = self._shading.is_glass[self._shading.surfaces(view.hits)]
        some = np.flatnonzero(is_glass & (opacity > 0.0))
        passed = self._shading.refracted(view.take(some), colors[some], self.paths.channel)
        shares[some] = passed.shares
        self._media[indices[some]] = passed.media
        rays = Rays(*(values.copy() for values in view.rays))
        rays.origins_m[some], rays.directions[some] = passed.rays.origins_m, passed.rays.directions
        return rays, shares
