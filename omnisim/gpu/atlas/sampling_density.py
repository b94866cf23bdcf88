"""What a picture needs of a face of the cube: which part of it, and how fine, piece by piece."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera

# Samples along a face's edge, corners included: a rim reaches a face first at the middle of an
# edge or at a corner.
GRID = 65
GRID_STEP = 2.0 / (GRID - 1)
# A pole of the picture stretches one direction without bound, the rim of an orthographic lens
# squeezes one to nothing. Neither is followed further than this: what the picture stretches
# across more than four times as much as along is drawn for four, and no pixel is taken to be
# wider than 32 of the finest.
MOST_STRETCH = 4.0
COARSEST_SHARE = 1.0 / 32.0
_STEP = 1e-5  # of a tangent, for derivatives: far above rounding, far below a texel


class Need(NamedTuple):
    """What the picture needs of a part of a face.

    Attributes:
        coarsest, finest: least and most pixels to a tangent of 1.
        core: (2, 2) least and largest tangents, right and down, that are looked up here; those of
            a face's parts do not overlap.
        window: (2, 2) likewise, but what the picture surely does not see is left out.
    """

    coarsest: float
    finest: float
    core: NDArray[np.float64]
    window: NDArray[np.float64]


class SamplingDensity:
    """What the picture needs of a face, by samples all over it.

    Args:
        camera: whose picture.
        face_from_optical: (3, 3).
        looked_up: tangents (n, 2) that the picture surely looks up.

    Attributes:
        is_seen: whether the picture sees the face at all.
    """

    def __init__(
        self,
        camera: CentralCamera,
        face_from_optical: NDArray[np.float64],
        looked_up: NDArray[np.float64],
    ):
        line = np.linspace(-1.0, 1.0, GRID)
        grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
        self._tangents = np.concatenate((grid, looked_up))

        def pixels(right: float, down: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
            local = np.ones((len(self._tangents), 3))
            local[:, :2] = self._tangents + np.array([right, down])
            return camera.pixel_from_ray(local @ face_from_optical)

        here, seen = pixels(0.0, 0.0)
        in_picture = np.all((here >= -1.0) & (here <= (camera.width_px, camera.height_px)), axis=-1)
        seen = seen & in_picture
        self.is_seen = bool(seen.any())
        if not self.is_seen:
            return
        self._shown = seen.copy()
        self._shown[len(grid) :] = True
        right, right_seen = pixels(_STEP, 0.0)
        down, down_seen = pixels(0.0, _STEP)
        steps = np.stack((right - here, down - here), axis=-1)
        inner = seen & right_seen & down_seen
        # A picture of everything is cut open somewhere, and at its poles all azimuths meet: there a
        # step leaps. No face is so fine that one would move the picture by a pixel otherwise.
        smooth = inner & np.all(np.abs(steps) < 1.0, axis=(-2, -1))
        self._inner = smooth if smooth.any() else inner
        stretches = np.linalg.svd(steps[self._inner] / _STEP, compute_uv=False)
        self._finest = np.zeros(len(seen))
        self._finest[self._inner] = np.minimum(stretches[:, 0], MOST_STRETCH * stretches[:, 1])
        self._coarsest = np.full(len(seen), np.inf)
        self._coarsest[self._inner] = stretches[:, 1]

    def whole(self) -> Need | None:
        """What the picture needs of the face; None: nothing."""
        everything = np.array([[-1.0, -1.0], [1.0, 1.0]])
        return self._inside(everything) if self.is_seen else None

    def parts(self, texels_per_pixel: float, tile_texels: float) -> list[Need]:
        """What it needs, cut into parts where that spares texels.

        The picture needs a face fine in one place and coarse in another: at 45° down a mirror shows
        the same angle in half as many pixels as above the horizon. Each part is as fine as it must
        be. Greedy: the cut that spares most is made first, and each half is cut again.

        Args:
            texels_per_pixel: to a side of a pixel.
            tile_texels: what one more tile costs, in texels.
        """
        if not self.is_seen:
            return []
        finest, shown = self._on_grid()
        everything = ((0, 0), (GRID - 1, GRID - 1))
        cells = _cut(finest * texels_per_pixel, shown, tile_texels, *everything)
        parts = [self._inside(-1.0 + GRID_STEP * np.array(cell, dtype=float)) for cell in cells]
        return [part for part in parts if part is not None]

    def _inside(self, core: NDArray[np.float64]) -> Need | None:
        """What the picture needs inside of tangents (2, 2)."""
        # what is seen may begin anywhere between two samples
        near = np.all(
            (self._tangents >= core[0] - GRID_STEP) & (self._tangents <= core[1] + GRID_STEP),
            axis=-1,
        )
        shown = self._tangents[near & self._shown]
        if not len(shown):
            return None
        window = np.stack((shown.min(axis=0) - GRID_STEP, shown.max(axis=0) + GRID_STEP))
        window = np.clip(window, core[0], core[1])
        if np.any(window[0] >= window[1]):
            return None
        finest = float(self._finest[near].max())
        if finest == 0.0:  # nothing can be told here: as elsewhere on the face
            finest = float(self._finest.max())
            near = np.ones_like(near)
        coarsest = float(self._coarsest[near].min()) if finest > 0.0 else 1.0
        return Need(max(coarsest, COARSEST_SHARE * finest, 1e-6), finest, core, window)

    def _on_grid(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Pixels to a tangent of 1, and what is seen, (GRID, GRID), rows down the face.

        Between two samples the finest of both counts, and what either sees.
        """
        count = GRID * GRID
        finest = self._finest[:count].reshape(GRID, GRID)
        shown = self._shown[:count].reshape(GRID, GRID).copy()
        column, row = np.clip(
            np.floor((self._tangents[count:].T + 1.0) / GRID_STEP).astype(int), 0, GRID - 2
        )
        for down in (0, 1):
            for right in (0, 1):
                shown[row + down, column + right] = True
        return _spread(finest), _spread(shown)


def _spread(values: NDArray) -> NDArray:
    """The largest of each value and those beside it."""
    for axis in (0, 1):
        padded = np.pad(values, [(1, 1) if axis == own else (0, 0) for own in (0, 1)])
        size = values.shape[axis]
        values = np.max(
            [np.take(padded, range(step, step + size), axis=axis) for step in (0, 1, 2)], axis=0
        )
    return values


Cell = tuple[tuple[int, int], tuple[int, int]]  # column and row of the first and last sample


def _cut(
    finest: NDArray[np.float64],
    shown: NDArray[np.bool_],
    tile_texels: float,
    first: tuple[int, int],
    last: tuple[int, int],
) -> list[Cell]:
    """Cells into which to cut what lies between two samples; those that show nothing left out."""
    rows, columns = slice(first[1], last[1] + 1), slice(first[0], last[0] + 1)
    inside, seen = finest[rows, columns], shown[rows, columns]
    if not seen.any():
        return []
    # along rows: cuts between what is above and what is below; along columns: left and right
    below = _texels_up_to(inside, seen, tile_texels)
    above = _texels_up_to(inside[::-1], seen[::-1], tile_texels)[::-1]
    left = _texels_up_to(inside.T, seen.T, tile_texels)
    right = _texels_up_to(inside.T[::-1], seen.T[::-1], tile_texels)[::-1]
    best_row, best_column = (below + above)[1:-1], (left + right)[1:-1]
    cheapest_row = best_row.min(initial=np.inf)
    cheapest_column = best_column.min(initial=np.inf)
    if min(cheapest_row, cheapest_column) >= below[-1]:
        return [(first, last)]
    if cheapest_row <= cheapest_column:
        row = first[1] + 1 + int(np.argmin(best_row))
        halves = ((first, (last[0], row)), ((first[0], row), last))
    else:
        column = first[0] + 1 + int(np.argmin(best_column))
        halves = ((first, (column, last[1])), ((column, first[1]), last))
    return [cell for half in halves for cell in _cut(finest, shown, tile_texels, *half)]


def _texels_up_to(
    finest: NDArray[np.float64], shown: NDArray[np.bool_], tile_texels: float
) -> NDArray[np.float64]:
    """What a tile of the rows 0 to i would cost, for each i, in texels."""
    count = np.arange(len(shown))
    any_row = shown.any(axis=1)
    top = np.maximum.accumulate(np.where(any_row, count, -1))
    bottom = int(np.argmax(any_row)) if any_row.any() else 0
    up_to = np.maximum.accumulate(shown, axis=0)
    width = shown.shape[1] - 1 - np.argmax(up_to[:, ::-1], axis=1) - np.argmax(up_to, axis=1)
    scale = GRID_STEP * np.maximum.accumulate(finest.max(axis=1))
    height = np.maximum(top - bottom, 1)
    texels = (height * scale + 2.0) * (np.maximum(width, 1) * scale + 2.0) + tile_texels
    return np.where(top >= 0, texels, 0.0)
