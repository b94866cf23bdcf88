"""Sample files, and rays of a camera in its rig's frame."""

from pathlib import Path

import numpy as np

FOLDER = Path(__file__).with_name("samples")
SAMPLES = sorted(path for path in FOLDER.iterdir() if path.is_file())

# the FOV model is none of ours: reading it is a fit, which takes its time
EXACT_SAMPLES = [path for path in SAMPLES if path.name != "kalibr_fov.yaml"]


def rig_rays(camera, count=33):
    """Rays of pixels all over a camera's image, edges included, in its rig."""
    u, v = (
        np.rint(np.linspace(0, side - 1, count)) for side in (camera.width_px, camera.height_px)
    )
    rays = camera.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    return rays.directions @ camera.rig_from_optical.T, rays.valid
