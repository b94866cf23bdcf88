"""Pipeline of a non-central camera."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.capture.parallax_pass import ChromaticPass, ParallaxPass
from omnisim.rendering.opengl.capture.parallax_rays import SampleRays
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.drawing.cube_pass import CubePass
from omnisim.rendering.opengl.pipeline import Pipeline
from omnisim.rendering.readback import ScenePoses

# Linear RGB (n, 3) along rays (n,), with the scene at some poses.
CastAt = Callable[[ScenePoses, SampleRays], NDArray[np.float32]]


class ParallaxPipeline(Pipeline):
    """Pipeline that renders from the viewpoint nearest to all rays.

    Args:
        cube: virtual cameras.
        samples: pixel map of the supersampled camera; sets the size.
        parallax: pass that samples the atlas.
        viewpoint_m: (3,) rig frame.
        cast: function that colors undecided samples by rays; None: treat occluders as thin.
        supersampling, linear_type: see `Pipeline`.

    Attributes:
        undecided_samples: number of undecided samples since the attribute was last set to 0.
    """

    def __init__(
        self,
        cube: CubePass,
        samples: PixelMap,
        parallax: ParallaxPass | ChromaticPass,
        viewpoint_m: NDArray[np.float64],
        cast: CastAt | None,
        supersampling: int,
        linear_type: str,
    ):
        self._parallax, self._viewpoint_m, self._cast = parallax, viewpoint_m, cast
        self.undecided_samples = 0
        super().__init__(cube, samples, supersampling, "f2" if linear_type == "f2" else "f4")

    def _make_pass(self, samples: PixelMap, supersampling: int) -> None:
        """Do nothing: the parallax pass is the image pass."""

    def draw(self, poses: ScenePoses, linear: bool) -> None:
        """Draw the encoded image and, on request, the linear one."""
        pose, cast = poses.world_from_rig.copy(), self._cast
        pose[:3, 3] += pose[:3, :3] @ self._viewpoint_m
        atlas = self._cube.render(pose, poses.world_from_objects)
        self._parallax.draw(
            atlas,
            self._cube.depth,
            self._both_targets if linear else self.encoded_target,
            None if cast is None else lambda rays: cast(poses, rays),
        )
        self.undecided_samples += self._parallax.undecided_samples
