"""Uniforms of programs, set from NumPy arrays."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Fog


def find_uniform(
    program: moderngl.Program | moderngl.ComputeShader, name: str
) -> moderngl.Uniform | None:
    """Uniform of a program; None if the compiler removed it."""
    member = program.get(name, None)
    return member if isinstance(member, moderngl.Uniform) else None


def uniform(program: moderngl.Program | moderngl.ComputeShader, name: str) -> moderngl.Uniform:
    """Uniform of a program.

    Raises:
        KeyError: no uniform of that name.
    """
    member = find_uniform(program, name)
    if member is None:
        raise KeyError(name)
    return member


def set_sampler(program: moderngl.Program, name: str, unit: int) -> None:
    """Set the texture unit of a sampler, unless the compiler removed it."""
    member = find_uniform(program, name)
    if member is not None:
        member.value = unit


def write_fog(program: moderngl.Program, fog: Fog) -> None:
    """Set the uniforms of shaders/scene/fog.glsl, if a program has them."""
    for name, value in (
        ("u_fog_color", fog.color), ("u_fog_attenuation_per_m", fog.attenuation_per_m)
    ):  # fmt: skip
        member = find_uniform(program, name)
        if member is not None:
            member.value = value


def columns_first(matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """Matrices (..., n, n) as float32 in OpenGL's column-major order."""
    return np.ascontiguousarray(np.swapaxes(matrices, -1, -2), dtype=np.float32)
