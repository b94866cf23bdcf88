"""Texture arrays: the memory that their layers hold."""

import ctypes
import gc

import numpy as np

from omnisim.rendering.opengl.gl.context import collect_garbage
from omnisim.rendering.opengl.world.scene_textures import MaterialTextures, TextureArray


def _exists(name):
    is_texture = ctypes.CDLL("libGL.so.1").glIsTexture
    is_texture.restype = ctypes.c_ubyte
    return bool(is_texture(name))


def test_layers_go_with_their_array(context):
    pixels = np.zeros((4, 4, 4), dtype=np.uint8)
    array = TextureArray(context, [[pixels], [pixels]], (True, True))
    names = [layer.glo for layer in array.layers]
    collect_garbage(context)
    assert [_exists(name) for name in names] == [True, True]
    del array
    gc.collect()
    collect_garbage(context)
    assert [_exists(name) for name in names] == [False, False]


def test_white_stays_as_long_as_the_textures(context):
    textures = MaterialTextures(context)
    name = textures._white.texture.glo
    gc.collect()
    collect_garbage(context)
    assert _exists(name)
