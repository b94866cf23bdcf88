"""Frames without end, single and in batches of changing sizes: memory stays what it was."""

import ctypes
import dataclasses
from collections import Counter
from typing import NamedTuple

import numpy as np

from omnisim import OmniCamera, Renderer, load_scene, pose
from omnisim.rendering.stage import Stage
from tests.rendering.opengl.sheets import LAMP, SUN, dynamic_object, mixed_scene
from tests.soak.renderers import resident_bytes

# Bytes, whatever the number of frames: what batches of changing sizes free comes back in parts,
# which moves the memory up and down by 5 MB. Kept images of 6000 frames would take 10 MB.
MAX_GROWTH = 8e6
SIZES_PX = (24, 40)
BATCHES = (16, 5, 40, 40, 1, 23)  # more and fewer than before, and the same
CHANNELS = ("rgba", "range", "instance", "flow")


def _shadowed():
    lamp, sun = (dataclasses.replace(one, casts_shadow=True) for one in (LAMP, SUN))
    return mixed_scene(lamp, sun), dynamic_object()


SCENES = {
    "sheets": lambda: (mixed_scene(),),
    "shadows": _shadowed,
    "soccer": lambda: (load_scene("soccer"),),
    "courtyard": lambda: (load_scene("courtyard"),),
}


KINDS = (
    "Buffer", "Framebuffer", "Program", "Renderbuffer", "Sampler", "Shader", "Texture",
    "VertexArray",
)  # fmt: skip
MAX_NAMES = 1 << 13


def gl_objects() -> Counter[str]:
    """Objects of the current context by kind, of any owner: their names are small numbers."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    found: Counter[str] = Counter()
    for kind in KINDS:
        address = egl.eglGetProcAddress(f"glIs{kind}".encode())
        exists = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(address)
        found[kind] = sum(exists(name) for name in range(1, MAX_NAMES))
    return found


class Growth(NamedTuple):
    """Most of the last third of a run above the most of the second."""

    memory: float  # resident bytes
    objects: Counter[str]  # of OpenGL, by kind; those that grew

    @property
    def is_flat(self) -> bool:
        """Nothing grew."""
        return self.memory <= MAX_GROWTH and not self.objects


def frames(times: int, scene: str = "sheets", print_line=print) -> Growth:
    """Render about `times` frames of two cameras in a scene."""
    poses = np.stack([pose((0.05 * k - 1.0, 0.0, 0.8), yaw_deg=9.0 * k) for k in range(40)])
    done, printed, most = 0, 0, [0, 0, 0]
    objects = [Counter(), Counter(), Counter()]
    cameras = [OmniCamera().resized(size).with_quality("fast") for size in SIZES_PX]
    with Stage(*SCENES[scene]()) as stage:
        renderers = [stage.open(camera) for camera in cameras]
        while done < times:
            third = 3 * done // times
            for renderer in renderers:
                done += _round(renderer, poses)
            most[third] = max(most[third], resident_bytes())
            with renderers[0]._passes.cube._context:
                objects[third] |= gl_objects()
            if done - printed >= 5000:
                printed = done
                held = objects[third].total()
                print_line(
                    f"{scene}, {done} of {times} frames: at most {most[third] / 1e6:.1f} MB, "
                    f"{held} objects"
                )
        for renderer in renderers:
            renderer.close()
    return Growth(most[2] - most[1], objects[2] - objects[1])


def _round(renderer: Renderer, poses) -> int:
    """Render frames, batches and ground truth of both; return how many images."""
    done = 0
    for count in BATCHES:
        renderer.render_batch(poses[:count])
        for one in poses[:4]:
            renderer.render(one)
        done += count + 4
    renderer.render(poses[0], also=("range", "albedo"))
    renderer.render_batch(poses[:2], channels=CHANNELS, next_states=poses[1:3])
    return done + 3
