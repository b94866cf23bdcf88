"""The probes do what they say that they time."""

import numpy as np
import pytest

from benchmarks.gl_counters import count
from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.probes import fill, probe, readback, submission, surfaces, triangles
from benchmarks.settings import at_setting
from omnisim import OmniCamera, open_sensor
from omnisim.scene import load_scene


@pytest.fixture(autouse=True)
def once(monkeypatch):
    """As often as it takes to be sure of a rate: once."""
    monkeypatch.setattr(probe, "MIN_SECONDS", 0.0)


def _counts(context, work):
    with context:
        return count(context, work)


def test_each_fill_fills_each_pixel(context):
    for one in fill.fill_probes(context, 32):
        assert (one.amount, one.unit) == (32**2, "px")
        one.work()


def test_small_triangles_are_seen_or_thrown_away(context, monkeypatch):
    drawn = {}

    def counting(context, name, unit, amount, once):
        drawn[name] = (amount, _counts(context, lambda: once(0)))

    monkeypatch.setattr(triangles, "repeated", counting)
    triangles.triangle_probes(context)
    for name, (amount, counts) in drawn.items():
        assert counts.triangles == amount
        if name == triangles.VISIBLE:
            # they cover the image without a gap, about one sample each
            assert counts.samples == triangles._TARGET_PX**2
            assert 0.5 < counts.samples / amount < 2.0
        else:
            assert counts.samples == 0
    assert drawn[triangles.OUTSIDE][1].triangles_inside in (0, None)


def test_readback_returns_the_drawn_color(context):
    for one, side in zip(readback.readback_probes(context), (360, 360, 1024, 1024), strict=True):
        assert one.amount in (4 * side**2, 3 * side**2)
        one.work()
    with context:
        pixels = np.zeros((4, 4, 3), np.uint8)
        target = context.framebuffer([context.renderbuffer((4, 4), 4)])
        target.clear(0.2, 0.4, 0.6, 1.0)
        target.read_into(pixels, components=3)
    assert np.all(pixels == (51, 102, 153))


def test_all_calls_of_a_probe_reach_the_gpu(context, monkeypatch):
    drawn = {}

    def counting(context, name, unit, amount, once):
        drawn[name] = (amount, _counts(context, lambda: once(0)).triangles)

    monkeypatch.setattr(submission, "repeated", counting)
    submission.submission_probes(context)
    for name, (amount, submitted) in drawn.items():
        draws_nothing = name in (submission.UNIFORM, submission.NOTHING)
        assert submitted == (0 if draws_nothing else amount), name


def test_rates_are_amounts_by_seconds():
    one = probe.Probe("x", "px", 6.0, lambda: None)
    assert one.rates(np.array([2.0, 3.0])).tolist() == [3.0, 2.0]


def test_probes_are_repeated_until_a_clock_can_tell(context, monkeypatch):
    done = []
    ticks = iter(np.arange(1000) * 1.0)
    # three times each; a call takes a second, whatever it does, so that the first try is enough
    monkeypatch.setattr(probe.time, "perf_counter", lambda: next(ticks))
    monkeypatch.setattr(probe, "MIN_SECONDS", 1.0)
    one = probe.repeated(context, "x", "px", 5.0, done.append)
    assert (one.amount, done) == (5.0, [0, 0, 0])
    monkeypatch.setattr(probe, "MIN_SECONDS", 2.0)
    monkeypatch.setattr(probe, "MAX_REPEATS", 4)
    assert probe.repeated(context, "x", "px", 5.0, done.append).amount == 20.0


@pytest.mark.usefixtures("needs_opengl")
def test_every_texel_of_the_empty_room_is_shaded_once():
    room = surfaces.empty_room(load_scene("rings"))
    mesh = room.meshes[0]
    a, b, c = mesh.positions[mesh.triangles].transpose(1, 0, 2)
    # fronts face the middle of the room, as normals do
    fronts = np.cross(b - a, c - a)
    assert np.all(np.sum(fronts * a, axis=1) < 0.0)
    assert np.all(np.sum(fronts * mesh.normals[mesh.triangles[:, 0]], axis=1) > 0.0)
    camera = at_setting(OmniCamera(), "fast").resized(48)
    samples = []
    with open_sensor(room, camera) as renderer:
        for shift_m in (0.0, 0.4 * surfaces.HALF_M):  # the walls are elsewhere, but all around
            x, y, z = room.start.position_m
            at = camera.base_pose((x + shift_m, y, z - shift_m))
            samples.append(RepeatedFrame(renderer, at).count().virtual_cameras.samples)
    assert samples[0] == samples[1] > 48**2
