"""Light gathered at points from patches, emissive surfaces and the sky."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.emitters import Emitters, Points
from omnisim.rendering.baking.sampling import Floats, cosine_directions, spread_points, turned
from omnisim.rendering.baking.transport import INSIDE, SKY, PatchHits, Transport
from omnisim.scene.model import Lighting

_RAYS_AT_ONCE = 1 << 17


class GatheredLight(NamedTuple):
    """Gathered light at points, on white surfaces.

    Attributes:
        light: (n, 3) mean of rays: light of emissive patches and sky, and `radiosity`.
        halves: (n, 2, 3) the same from the even and the odd rays, separately.
        is_valid: (n,) at least one ray did not hit the inside of a solid.
    """

    light: Floats
    halves: Floats
    is_valid: NDArray[np.bool_]


class Gatherer:
    """Gathers light with cosine-distributed rays.

    Args:
        lighting: lighting of the scene, with the sky.
        transport: ray casting in the scene.
        samples: rays per place.
    """

    def __init__(self, lighting: Lighting, transport: Transport, samples: int):
        self._transport, self._samples = transport, samples
        self._ambient = np.array(lighting.ambient, dtype=np.float32)
        self._environment = lighting.environment
        self._points = spread_points(samples)

    def sky(self, directions: Floats) -> Floats:
        """Sky light (n, 3) along directions (n, 3)."""
        if self._environment is None:
            return np.broadcast_to(self._ambient, directions.shape)
        return self._ambient + self._environment.seen(directions)

    def hits(
        self, places: list[Points], shifts: Floats, first: int, last: int
    ) -> tuple[PatchHits, Floats]:
        """Hits and cosines of the rays `first` to `last` from origins (n,).

        Args:
            places: origins (n,) for the rays, used in turn.
            shifts: (n, 2) shifts of the directions, one per place.
            first, last: range of rays.
        """
        count = last - first
        origins = np.empty((len(shifts), count, 3), dtype=np.float32)
        directions = np.empty_like(origins)
        cosines = np.empty((len(shifts), count), dtype=np.float32)
        points = turned(self._points[first:last], shifts)
        for number, at in enumerate(places):
            part = slice((number - first) % len(places), None, len(places))
            origins[:, part] = at.origins_m[:, None]
            toward, cosines[:, part] = cosine_directions(points[:, part], at.normals)
            below = np.einsum("nkc,nc->nk", toward, at.planes)
            toward -= 2.0 * np.minimum(below, 0.0)[..., None] * at.planes[:, None]
            directions[:, part] = toward
        aims = directions.reshape(-1, 3)
        return self._transport.cast(origins.reshape(-1, 3), aims), cosines.ravel()

    def gather(
        self, places: list[Points], shifts: Floats, radiosity: Floats, emitters: Emitters
    ) -> GatheredLight:
        """Light at places (n,) from patches of radiosity (p, 3), emitters and sky."""
        count = len(shifts)
        halves = np.zeros((count, 2, 3), dtype=np.float32)
        numbers = np.zeros((count, 2), dtype=np.float32)
        step = max(2, _RAYS_AT_ONCE // max(count, 1) // 2 * 2)
        for first in range(0, self._samples, step):
            last = min(first + step, self._samples)
            hits, cosines = self.hits(places, shifts, first, last)
            light = self.seen(hits, cosines, radiosity, emitters)
            light = light.reshape(count, -1, 3)
            valid = (hits.patches != INSIDE).reshape(count, -1)
            for half in (0, 1):
                halves[:, half] += light[:, half::2].sum(axis=1)
                numbers[:, half] += valid[:, half::2].sum(axis=1)
        light = halves.sum(axis=1) / np.maximum(numbers.sum(axis=1), 1.0)[:, None]
        halves /= np.maximum(numbers, 1.0)[..., None]
        return GatheredLight(light, halves, numbers.sum(axis=1) > 0.0)

    def seen(
        self,
        hits: PatchHits,
        cosines: Floats,
        radiosity: Floats,
        emitters: Emitters,
    ) -> Floats:
        """Light (n, 3) along rays."""
        light = np.zeros((len(cosines), 3), dtype=np.float32)
        free = np.flatnonzero(hits.patches == SKY)
        light[free] = self.sky(hits.directions[free])
        some = np.flatnonzero(hits.patches >= 0)
        on_patches = hits.take(some)
        light[some] = radiosity[on_patches.patches] + emitters.seen(on_patches, cosines[some])
        return light * hits.shares
