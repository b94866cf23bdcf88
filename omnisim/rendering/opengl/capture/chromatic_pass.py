"""Image pass with separate rays for red, green and blue."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.depth_pyramid import DepthPyramid
from omnisim.rendering.opengl.capture.parallax_pass import CastSamples, ParallaxPass
from omnisim.rendering.opengl.capture.parallax_rays import ParallaxRays
from omnisim.scene.model import Fog

_GREEN = 1  # its rays decide which pixels are valid


class ChromaticPass:
    """Image pass of a refracting camera: one pass per channel, from one atlas.

    Args:
        context: OpenGL context.
        rays: sample rays of R, G and B from the viewpoint, rig frame.
        plan: tiles of the atlas.
        pyramid: hierarchical depth of the atlas.
        fog: see `ParallaxPass`.

    Attributes:
        undecided_samples: number of undecided samples in the last image, all channels.

    Raises:
        GraphicsError: out of GPU memory.
    """

    def __init__(
        self,
        context: moderngl.Context,
        rays: Sequence[ParallaxRays],
        plan: TilePlan,
        pyramid: DepthPyramid,
        fog: Fog | None = None,
    ):
        self._pyramid, self.undecided_samples = pyramid, 0
        shown = rays[_GREEN].valid_shares() >= 0.5
        self._passes = [ParallaxPass(context, one, plan, pyramid, shown, fog) for one in rays]

    def draw(
        self,
        atlas: moderngl.Texture,
        depth: moderngl.Texture,
        target: moderngl.Framebuffer,
        cast: CastSamples | None,
    ) -> None:
        """Draw the pixels that are valid in green, see `ParallaxPass.draw`."""
        self._pyramid.update(depth)
        self.undecided_samples = 0
        for channel, one in enumerate(self._passes):
            _write_only(target, [channel == color for color in range(3)] + [channel == _GREEN])
            try:
                one.draw_again(atlas, target, cast)
            finally:
                _write_only(target, [True] * 4)
            self.undecided_samples += one.undecided_samples


def _write_only(target: moderngl.Framebuffer, channels: Sequence[bool]) -> None:
    """Set the RGBA channels that drawing writes, in all attachments."""
    mask, count = tuple(channels), len(target.color_attachments)
    masks = mask if count == 1 else (mask,) * count
    setattr(target, "color_mask", masks)  # noqa: B010  moderngl's stubs know one attachment only
