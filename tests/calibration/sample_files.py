"""The sample files, and a camera's rays from a file."""

from pathlib import Path

from omnisim.cameras import pixel_grid

FOLDER = Path(__file__).with_name("samples")
SAMPLES = sorted(path for path in FOLDER.iterdir() if path.is_file())


def rig_rays(camera, step=7):
    """Rays of some of a camera's pixels in its rig, which mirrors and lenses have in common."""
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px)[::step, ::step])
    return rays.directions @ camera.rig_from_optical.T, rays.valid
