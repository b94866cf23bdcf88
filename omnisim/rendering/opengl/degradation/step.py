"""Step of an image's degradation, as data: to describe one opens no OpenGL."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

UniformValue = float | tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Step:
    """Degradation on the GPU: a shader and its parameters.

    Attributes:
        shader: stem of the file in `shaders/degradation`.
        uniforms: constant values, by name.
        textures: constant (height, width, channels) float32, by the name of their sampler.
    """

    shader: str
    uniforms: Mapping[str, UniformValue] = field(default_factory=dict)
    textures: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
