"""Hierarchical z buffer, beside the farthest depth of every cell."""

import math

import numpy as np
import pytest

from omnisim.rendering.opengl.culling.cluster_culling import DEPTH_UNIT, SETTINGS
from omnisim.rendering.opengl.gl.buffers import gpu_buffer, read_buffer
from omnisim.rendering.opengl.gl.shader_files import build_compute_shader
from tests.rendering.opengl.depths import drawn_depth

CELL_PX, LEVELS, SIDE = 2, 6, 32


@pytest.mark.parametrize("shape", [(64, 96), (61, 83), (130, 7), (3, 3), (200, 300)])
def test_each_cell_has_its_farthest_depth(context, shape):
    generator = np.random.default_rng(shape)
    values = generator.uniform(0.1, 0.9, shape).astype(np.float32)
    values[generator.random(shape) < 1e-3] = 0.0
    fine = build_compute_shader(context, "culling/hi_z.comp")
    fine["u_atlas_depth"] = DEPTH_UNIT
    coarse = build_compute_shader(context, "culling/hi_z.comp", ["COARSE"])
    groups = [math.ceil(side / (CELL_PX * SIDE)) for side in shape[::-1]]
    cells = [groups[0] * groups[1] * (SIDE >> level) ** 2 for level in range(LEVELS)]
    buffer = gpu_buffer(context, 4 * sum(cells))
    buffer.bind_to_storage_buffer(11)
    drawn_depth(context, values).use(DEPTH_UNIT)
    settings = np.zeros(1, dtype=SETTINGS)
    settings["atlas_px"] = shape[::-1]
    gpu_buffer(context, settings).bind_to_uniform_block(0)
    fine.run(*groups)
    context.memory_barrier()
    coarse.run(*(math.ceil(side / 8) for side in groups))
    context.finish()
    found = np.split(np.frombuffer(read_buffer(buffer), np.float32), np.cumsum(cells)[:-1])
    for level, of_level in enumerate(found):
        cell = CELL_PX << level
        of_level = of_level.reshape(groups[1] * (SIDE >> level), groups[0] * (SIDE >> level))
        for row in range(math.ceil(shape[0] / cell)):
            for column in range(math.ceil(shape[1] / cell)):
                own = values[row * cell : (row + 1) * cell, column * cell : (column + 1) * cell]
                assert of_level[row, column] == own.min()
