"""Counters, frames taken apart, and probes: they count and do what they say that they time."""

import moderngl
import numpy as np
import pytest

from benchmarks.gl_counters import count
from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.probes import fill, probe, readback, submission, triangles
from benchmarks.seen_triangles import count_seen_triangles
from omnisim import OmniCamera, open_sensor
from omnisim.core.poses import pose
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback
from omnisim.scene import load_scene
from omnisim.scene.model import AlphaMode, Material, Mesh
from tests.scenes import scene_of

CAMERA = OmniCamera(polygons=None).resized(64)


@pytest.fixture
def frame(needs_opengl):
    scene = load_scene("rings")
    camera = OmniCamera(supersampling=1, texels_per_pixel=1.0).resized(64)
    with open_sensor(scene, camera) as renderer:
        yield RepeatedFrame(renderer, camera.base_pose(scene.start.position_m))


def test_a_frame_in_parts_is_the_frame_and_leaves_nothing_changed(frame, monkeypatch):
    before = (PixelReadback.start, moderngl.VertexArray.render)
    image, images, render = frame.render(), [], frame.render
    counts = frame.count()
    assert counts == frame.count()
    assert counts.draws >= counts.calls > 2  # clusters, near and far, and the image
    monkeypatch.setattr(frame, "render", lambda: images.append(render()))
    parts = frame.parts()
    assert np.array_equal(images[0], image)
    assert min(parts) > 0.0
    monkeypatch.setattr(frame, "render", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        frame.parts()
    assert (PixelReadback.start, moderngl.VertexArray.render) == before
    assert "render" not in vars(frame.renderer._passes.cube)


@pytest.mark.parametrize(
    ("module", "probes"),
    [(triangles, triangles.triangle_probes), (submission, submission.submission_probes)],
)
def test_probes_draw_what_they_count(module, probes, context, monkeypatch):
    monkeypatch.setattr(probe, "MIN_SECONDS", 0.0)
    drawn = {}

    def counting(context, name, unit, amount, once):
        with context:
            drawn[name] = amount, count(context, lambda: once(0))

    monkeypatch.setattr(module, "repeated", counting)
    probes(context)
    for name, (amount, counts) in drawn.items():
        draws_nothing = name in (submission.UNIFORM, submission.NOTHING)
        assert counts.triangles == (0 if draws_nothing else amount), name
        if module is triangles:  # they cover the image without a gap, about one sample each
            assert counts.samples == (triangles._TARGET_PX**2 if name == triangles.VISIBLE else 0)


def test_probes_are_repeated_until_a_clock_can_tell(context, monkeypatch):
    monkeypatch.setattr(probe, "MIN_SECONDS", 0.0)
    for one in (*fill.fill_probes(context, 32), *readback.readback_probes(context)):
        one.work()
    done, ticks = [], iter(np.arange(1000) * 1.0)  # a call takes a second, whatever it does
    monkeypatch.setattr(probe.time, "perf_counter", lambda: next(ticks))
    monkeypatch.setattr(probe, "MIN_SECONDS", 2.0)
    monkeypatch.setattr(probe, "MAX_REPEATS", 4)
    assert probe.repeated(context, "x", "px", 5.0, done.append).amount == 20.0
    assert probe.Probe("x", "px", 6.0, lambda: None).rates(np.array([2.0])).tolist() == [3.0]


def wall(distance_m, half_m, material=0, flipped=False):
    """Two triangles ahead of the origin that turn their front to it, or their back."""
    corners = [(distance_m, y, z) for y, z in ((half_m, -half_m), (-half_m, -half_m))]
    corners += [(distance_m, y, z) for y, z in ((-half_m, half_m), (half_m, half_m))]
    positions = np.float32(corners) - np.float32((0.0, 0.0, 0.3))  # below the mirror's rim
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    return Mesh("wall", positions, faces[:, ::-1] if flipped else faces, material)


FRONT, BACK = wall(2.0, 0.5), wall(2.0, 0.5, flipped=True)
GLASS = [Material(), Material(alpha_mode=AlphaMode.BLEND)]


@pytest.mark.parametrize(
    ("meshes", "yaw_deg", "options", "expected"),
    [
        ([FRONT, wall(3.0, 0.5)], 0.0, {}, 2),  # the farther one is hidden
        ([FRONT, wall(3.0, 2.0)], 0.0, {}, 4),
        ([FRONT], 180.0, {}, 2),
        ([FRONT], 45.0, {}, 4),  # once for each face of the cube
        ([BACK], 0.0, {}, 0),
        ([BACK], 0.0, {"materials": [Material(double_sided=True)]}, 2),
        ([FRONT], 0.0, {"poses": [np.diag([1.0, -1.0, 1.0, 1.0])]}, 2),
        ([wall(2.0, 0.5, 1), wall(3.0, 0.5)], 0.0, {"materials": GLASS}, 2),  # glass hides nothing
        ([FRONT], 0.0, {"poses": [pose((0.0, 0.0, 9.0))]}, 0),
    ],
)
def test_seen_triangles_are_shown_triangles(context, meshes, yaw_deg, options, expected):
    scene = scene_of(meshes, **{"materials": [Material()], **options})
    at = pose(yaw_deg=yaw_deg)
    seen = count_seen_triangles(context, scene, CAMERA.model, at, 64, CAMERA.near_m)
    assert seen == expected
