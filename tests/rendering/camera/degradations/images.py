"""Images to degrade, and the GPU's way of doing it without a scene."""

import numpy as np

from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass
from omnisim.rendering.opengl.gl.pixel_readback import read_once

GEOMETRY = ImageGeometry(97, 83, (47.3, 41.8))  # odd sizes, and an axis off the middle


def random_image(geometry=GEOMETRY, largest=1.3, seed=1):
    """Smooth light with noise on it, and a round mask with a hole."""
    generator = np.random.default_rng(seed)
    height, width = geometry.height_px, geometry.width_px
    image = np.ones((height, width, 4), dtype=np.float32)
    ramp = np.linspace(0.0, largest, width)[None, :, None] * np.linspace(1.0, 0.2, 3)
    image[..., :3] = ramp * generator.uniform(0.2, 1.0, (height, width, 3))
    radius = np.sqrt(geometry.squared_radii())
    image[(radius > 0.95) | (radius < 0.08)] = 0.0
    return image


def flat_image(values, height=64, width=256):
    """As many stripes as values, each of one gray."""
    image = np.ones((height * len(values), width, 4), dtype=np.float32)
    image[..., :3] = np.repeat(values, height)[:, None, None]
    return image


def on_gpu(context, images, optics=(), sensor=(), weights=None, uniforms=None):
    """Result of the pass for sub-frames (height, width, 4)."""
    height, width = images[0].shape[:2]
    chain = DegradationPass(context, (width, height), optics, sensor)
    for index, image in enumerate(images):
        texture = context.texture((width, height), 4, image.astype("<f4"), dtype="f4")
        chain.add(texture, None if weights is None else weights[index])
    chain.finish(uniforms or {"u_frame": 0})
    return read(chain.finished)


def read(texture):
    """Texels (height, width, 4) of a linear image."""
    texels = np.empty((texture.height, texture.width, 4), dtype=np.float32)
    read_once(texture.ctx, (texture, texels))
    return texels
