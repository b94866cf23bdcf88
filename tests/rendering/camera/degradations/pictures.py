"""Pictures to degrade, and the GPU's way of doing it without a scene."""

import numpy as np

from omnisim.rendering.camera.degradations.picture_geometry import PictureGeometry
from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass

GEOMETRY = PictureGeometry(97, 83, (47.3, 41.8))  # odd sizes, and an axis off the middle


def random_picture(geometry=GEOMETRY, largest=1.3, seed=1):
    """Smooth light with noise on it, and a round mask with a hole."""
    generator = np.random.default_rng(seed)
    height, width = geometry.height_px, geometry.width_px
    picture = np.ones((height, width, 4), dtype=np.float32)
    ramp = np.linspace(0.0, largest, width)[None, :, None] * np.linspace(1.0, 0.2, 3)
    picture[..., :3] = ramp * generator.uniform(0.2, 1.0, (height, width, 3))
    radius = np.sqrt(geometry.squared_radii())
    picture[(radius > 0.95) | (radius < 0.08)] = 0.0
    return picture


def flat_picture(values, height=64, width=256):
    """As many stripes as values, each of one grey."""
    picture = np.ones((height * len(values), width, 4), dtype=np.float32)
    picture[..., :3] = np.repeat(values, height)[:, None, None]
    return picture


def on_gpu(context, pictures, optics=(), sensor=(), weights=None, uniforms=None):
    """Result of the pass for sub-frames (height, width, 4)."""
    height, width = pictures[0].shape[:2]
    chain = DegradationPass(context, (width, height), optics, sensor)
    for index, picture in enumerate(pictures):
        texture = context.texture((width, height), 4, picture.astype("<f4"), dtype="f4")
        chain.add(texture, None if weights is None else weights[index])
    chain.finish(uniforms or {"u_frame": 0})
    return chain.read()
