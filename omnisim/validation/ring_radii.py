"""Radii of rings around the principal point, measured in an image to a fraction of a pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.core.bilinear import sample

STEP_PX = 0.1


def ring_radii(
    darkness: NDArray[np.float64],
    center_px: tuple[float, float],
    expected_px: float,
    reach_px: float,
    azimuths: int = 720,
) -> NDArray[np.float64]:
    """Radii (azimuths,) of one dark ring at evenly spaced azimuths.

    The radius at an azimuth is the centroid of the darkness along that azimuth, within `reach_px`
    of the expected radius. Blur makes a ring's radial profile proportional to 1/√r; the centroid
    therefore weights darkness by √r.

    Args:
        darkness: image (height, width), 0 without a ring.
        center_px: (u, v) center of the rings.
        expected_px, reach_px: center and half width of the search interval, which must contain no
            other ring.
        azimuths: number of azimuths.
    """
    angles = 2.0 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    radii = expected_px + np.arange(-reach_px, reach_px + 0.5 * STEP_PX, STEP_PX)
    radii = radii[radii > 0.0]
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    profile = sample(darkness, directions[:, None] * radii[:, None] + np.asarray(center_px))
    weights = profile * np.sqrt(radii)
    means: NDArray[np.float64] = (weights * radii).sum(axis=1) / weights.sum(axis=1)
    return means
