"""Rays of all samples of an image as one array, for comparisons."""

import numpy as np

from omnisim.cameras import Rays


def all_samples(rays, camera):
    """Rays of samples in the optical frame, and their validity, row by row of the finer image."""
    side = rays.supersampling
    rows, columns = np.indices((side * camera.height_px, side * camera.width_px)).reshape(2, -1)
    parts = side * (rows % side) + columns % side
    rows, columns = rows // side, columns // side
    bits = rays.valid_bits()[camera.width_px * rows + columns]
    found = rays.of(rows, columns, parts)
    shape = side * camera.height_px, side * camera.width_px
    return Rays(
        (found.directions @ camera.rig_from_optical).reshape(*shape, 3),
        (bits >> parts.astype(np.uint64) & 1 == 1).reshape(shape),
        (found.origins_m @ camera.rig_from_optical).reshape(*shape, 3),
    )
