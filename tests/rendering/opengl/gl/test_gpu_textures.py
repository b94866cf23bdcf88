"""Textures that are refused by name, before or after OpenGL was asked, and incomplete targets."""

import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import gpu_textures
from omnisim.rendering.opengl.gl.buffers import AllocationError, gpu_allocation
from omnisim.rendering.opengl.gl.framebuffers import framebuffer


@pytest.mark.parametrize(
    ("make", "size", "limit"),
    [
        (lambda *of: gpu_textures.texture_2d(*of, 4), (1, 99_999), "GL_MAX_TEXTURE_SIZE"),
        (lambda *of: gpu_textures.renderbuffer(*of, 4), (99_999, 1), "GL_MAX_TEXTURE_SIZE"),
        (gpu_textures.depth_texture, (99_999, 1), "GL_MAX_TEXTURE_SIZE"),
        (gpu_textures.depth_array, (1, 1, 99_999), "GL_MAX_ARRAY_TEXTURE_LAYERS"),
    ],
)
def test_sizes_beyond_a_limit_are_refused_before_opengl_is_asked(context, make, size, limit):
    text = rf" of {' × '.join(map(str, size))} texels.*at most {context.info[limit]}"
    with pytest.raises(AllocationError, match=text):
        make(context, size)
    with (
        pytest.raises(GraphicsError, match=rf"^an atlas does not fit .*{text}\): fewer rings"),
        gpu_allocation("an atlas", "fewer rings"),
    ):
        make(context, size)


def test_an_error_is_seen_after_the_allocation_that_made_it(context, monkeypatch):
    # as if the driver stated limits that it does not keep
    monkeypatch.setattr(context, "_info", dict.fromkeys(context.info, 10**6))
    with pytest.raises(AllocationError, match=r"of 99999 × 1 texels .*\(GL_INVALID_VALUE\)"):
        gpu_textures.texture_2d(context, (99_999, 1), 4)
    assert context.error == "GL_NO_ERROR"


def test_a_target_that_is_not_complete_is_named_by_its_attachments(context):
    colors = [gpu_textures.renderbuffer(context, (4, 4), 4, samples=samples) for samples in (0, 4)]
    with pytest.raises(AllocationError, match=r"framebuffer of \(4, 4\), 4 × f1; \(4, 4\), 4 × f1"):
        framebuffer(context, colors)
