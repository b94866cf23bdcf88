"""Images and geoms by MuJoCo's own renderer, in an OpenGL context of its own.

The context is made here: the version of PyOpenGL that another oracle needs cannot make MuJoCo's.
"""

import ctypes

import mujoco
import numpy as np

SURFACELESS_MESA, OPENGL, PLATFORM_NONE = 0x31DD, 0x30A2, 0x3038


class OpenGL:
    """OpenGL context with the fixed functions that MuJoCo's renderer uses."""

    def __init__(self):
        self._egl = egl = ctypes.CDLL("libEGL.so.1")
        pointer, number = ctypes.c_void_p, ctypes.c_int
        egl.eglGetPlatformDisplay.restype = egl.eglCreateContext.restype = pointer
        egl.eglGetPlatformDisplay.argtypes = [ctypes.c_uint, pointer, pointer]
        for function in (egl.eglCreateContext, egl.eglMakeCurrent):
            function.argtypes = [pointer] * 4
        egl.eglDestroyContext.argtypes = [pointer] * 2
        egl.eglInitialize.argtypes = [pointer] * 3
        self._display = egl.eglGetPlatformDisplay(SURFACELESS_MESA, None, None)
        if not egl.eglInitialize(self._display, None, None) or not egl.eglBindAPI(OPENGL):
            raise OSError("no surfaceless EGL")
        attributes = (number * 1)(PLATFORM_NONE)
        self._context = egl.eglCreateContext(self._display, None, None, attributes)
        if not self._context:
            raise OSError("no OpenGL")

    def __enter__(self):
        self._egl.eglMakeCurrent(self._display, None, None, self._context)

    def __exit__(self, *_):
        self._egl.eglMakeCurrent(self._display, None, None, None)
        self._egl.eglDestroyContext(self._display, self._context)


def render(model, data, camera, width_px, height_px, mirrors=False):
    """Image (height, width, 3) uint8 and geoms (height, width), without shadows."""
    model.vis.global_.offwidth, model.vis.global_.offheight = width_px, height_px
    scene, view, option = mujoco.MjvScene(model, 1000), mujoco.MjvCamera(), mujoco.MjvOption()
    view.type = mujoco.mjtCamera.mjCAMERA_FIXED
    view.fixedcamid = model.camera(camera).id
    mujoco.mjv_updateScene(model, data, option, None, view, mujoco.mjtCatBit.mjCAT_ALL, scene)
    flags = mujoco.mjtRndFlag
    for flag in (flags.mjRND_SHADOW, flags.mjRND_REFLECTION, flags.mjRND_HAZE, flags.mjRND_FOG):
        scene.flags[flag] = 0
    scene.flags[flags.mjRND_REFLECTION] = int(mirrors)
    rectangle = mujoco.MjrRect(0, 0, width_px, height_px)
    found = []
    with OpenGL():
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        for segments in (0, 1):
            scene.flags[flags.mjRND_SEGMENT] = scene.flags[flags.mjRND_IDCOLOR] = segments
            pixels = np.empty((height_px, width_px, 3), np.uint8)
            mujoco.mjr_render(rectangle, scene, context)
            mujoco.mjr_readPixels(pixels, None, rectangle, context)
            found.append(pixels[::-1])
        context.free()
    ids = found[1].astype(np.int32) @ (1, 256, 65536)
    geom_of_segment = np.full(scene.ngeom + 1, -1)
    for geom in scene.geoms[: scene.ngeom]:
        if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
            geom_of_segment[geom.segid + 1] = geom.objid
    return found[0], geom_of_segment[ids]
