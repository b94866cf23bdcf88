"""Coordinate frames and the fixed rotations between them; `omnisim.core.poses` has variable ones.

world      meters, x and y on the ground, z up; a robot at yaw 0 faces +x (REP 103).
viewpoint  camera-relative world: the world's axes, the origin at the effective viewpoint. Near it
           float32 is precise, however far away the world's own origin is.
base       the vehicle that carries the sensor: x forward, y left, z up (REP 103).
rig        the sensor's own body at its effective viewpoint: x forward, y left, z up when mounted
           level. The cube faces are aligned with it.
optical    the camera, with axes as in its image: x right, y down, z forward, into the scene or into
           the mirror (OpenCV). The origin is the effective viewpoint.
mirror     x of the optical frame, z toward the pinhole: the frame of Eq. 1.

Every matrix is named target_from_source and maps column vectors of the source to the target.
Pixel (0, 0) is the center of the first pixel, so the image's corner is at (−0.5, −0.5) (OpenCV,
Kalibr).
"""

from __future__ import annotations

import numpy as np

from omnisim.core.arrays import Floats

# The camera looks up at the mirror with the rig's front at the top of the image. Seen from below,
# the left of the rig is on the right of the image: the view is from below, not flipped.
RIG_FROM_OPTICAL_LOOKING_UP: Floats = np.array(
    [
        [0.0, -1.0, 0.0],  # forward is up in the image
        [1.0, 0.0, 0.0],  # left is right in the image
        [0.0, 0.0, 1.0],  # up is into the mirror
    ]
)
# A camera that looks ahead: the vehicle's forward is into the image (REP 103, REP 105).
BASE_FROM_OPTICAL_LOOKING_AHEAD: Floats = np.array(
    [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
)
# A map of the ground: it looks straight down, forward is up in the image, left is left.
BASE_FROM_OPTICAL_LOOKING_DOWN: Floats = np.array(
    [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
)
# Half a turn about x: the camera looks into the mirror, the mirror's axis points at the camera.
MIRROR_FROM_OPTICAL: Floats = np.diag([1.0, -1.0, -1.0])
# Factors that reflect a ray in the image plane: from a mirror's optical frame to a lens's.
FLIP_Z: Floats = np.array([1.0, 1.0, -1.0])
