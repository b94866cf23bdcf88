"""Images by a table of UVs, beside images by textures of UVs; and what they cost."""

import dataclasses
import math

import moderngl
import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, EquirectangularCamera, KannalaBrandtCamera
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.capture import image_pass
from omnisim.rendering.opengl.capture.image_pass import MAX_TABLE_BYTES, RemapPass, fits_table
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback
from omnisim.rendering.stage import Stage
from omnisim.scene import load_scene
from tests.rendering.opengl.sheets import mixed_scene

SIZE_PX = 120
FISHEYE = EquidistantCamera(SIZE_PX, SIZE_PX, 36.0, (59.5, 59.5), theta_max_rad=math.radians(95.0))
ITERATED = KannalaBrandtCamera(
    SIZE_PX, SIZE_PX, (36.0, 36.0), (59.5, 59.5), (3.5e-3, 7e-4, -2e-3, 2e-4)
)
CAMERAS = {
    "exact mirror": OmniCamera(polygons=None).resized(SIZE_PX),
    "mesh": OmniCamera(polygons=64).resized(SIZE_PX),
    "fisheye": OmniCamera(model=FISHEYE, polygons=None),
    "iterated": OmniCamera(model=ITERATED, polygons=None),
    "equirectangular": OmniCamera(model=EquirectangularCamera(160, 80), polygons=None),
}


def _at_start(stage, camera):
    start = stage.scene.start
    return camera.base_pose(start.position_m, yaw_deg=start.yaw_deg)


def _take(stage, camera):
    with stage.open(camera) as renderer:
        has_table = isinstance(renderer._passes.frame.image_pass, RemapPass)
        return renderer.render(_at_start(stage, camera)).rgba, has_table


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_textures_show_what_tables_show(camera, monkeypatch):
    with Stage(mixed_scene()) as stage:
        for supersampling in (1, 3):
            finer = dataclasses.replace(camera, supersampling=supersampling, texels_per_pixel=2.0)
            stored, has_table = _take(stage, finer)
            assert has_table
            with monkeypatch.context() as patch:
                patch.setattr(image_pass, "fits_table", lambda _: False)
                drawn, has_table = _take(stage, finer)
            assert not has_table
            np.testing.assert_array_equal(drawn, stored)
            assert stored[stored[..., 3] > 0].std(axis=0)[:3].min() > 20.0  # there is much to see


def test_a_table_is_as_large_as_its_limit_at_most():
    side = math.isqrt(MAX_TABLE_BYTES // 8)
    assert fits_table(side**2)
    assert not fits_table((side + 1) ** 2)


class Calls:
    """Draws and writes of moderngl, and reads of images."""

    def __init__(self, patch):
        self.drawn, self.written, self.read = [], [], []
        render, write = moderngl.VertexArray.render, moderngl.Buffer.write
        start = PixelReadback.start

        def render_recorded(array, mode=None, vertices=-1, **options):
            self.drawn.append(array.vertices if vertices < 0 else vertices)
            return render(array, mode, vertices, **options)

        def write_recorded(buffer, data, **options):
            self.written.append(memoryview(data).nbytes)
            return write(buffer, data, **options)

        def read_recorded(readback, *reads):
            self.read += [out.nbytes for _, out in reads]
            return start(readback, *reads)

        patch.setattr(moderngl.VertexArray, "render", render_recorded)
        patch.setattr(moderngl.Buffer, "write", write_recorded)
        patch.setattr(PixelReadback, "start", read_recorded)


@pytest.mark.usefixtures("needs_opengl")
def test_a_mirrors_polygons_cost_nothing_in_a_frame(monkeypatch):
    calls = {}
    with Stage(load_scene("soccer")) as stage:
        for polygons in (16, 4096):
            camera = OmniCamera(polygons=polygons).with_quality("fast").resized(200)
            with stage.open(camera) as renderer:
                with monkeypatch.context() as patch:
                    calls[polygons] = Calls(patch)
                    renderer.render(_at_start(stage, camera))
                table = renderer._passes.frame.image_pass._tables.buffers[0].size
                assert table == 8 * 200 * 200 * camera.supersampling**2
    few, many = calls.values()
    assert few.drawn  # the image
    assert few.drawn == many.drawn
    assert few.written == many.written
    assert few.read == many.read == [4 * 200 * 200]
