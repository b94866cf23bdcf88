"""What is drawn chunk by chunk, beside what is drawn one instance after the other, whole."""

import dataclasses
from functools import partial

import numpy as np
import pytest

from omnisim.gpu.culling import cluster_culling
from omnisim.gpu.culling.hi_z import HiZ
from omnisim.gpu.scene.cube_pass import CubePass
from omnisim.poses import pose as make_pose
from omnisim.scene import load_scene
from omnisim.sensors import OmniCamera, Renderer, Stage
from tests.gpu.sheets import LAMP, SUN, crowd, dynamic_object, mixed_scene

FAST = OmniCamera().with_quality("fast")
ALWAYS, NEVER = 0, 10**9  # triangles that have to be left so that they are drawn in turns
# Matrices are multiplied in another order, and float32 rounds otherwise. A colour half-way between
# two steps of 8 bits then takes the other one: a step in up to 1 % of the pixels, 68 dB. And where
# two surfaces have the same depth, another one may be in front, or the edge of a triangle takes its
# own normal for turned away: in a pixel of ten thousand.
LEAST_DB = 65.0
MOST_OTHER = 1e-4


class Pictures:
    """Pictures of a scene, as always and with one thing otherwise."""

    def __init__(self, monkeypatch, stage, camera=FAST):
        self._monkeypatch, self._stage, self._camera = monkeypatch, stage, camera

    def take(self, world_from_base=None, worth=None, shows_hidden=False, **options):
        camera, start = self._camera, self._stage.scene.start
        if world_from_base is None:
            world_from_base = camera.base_pose(start.position_m, start.yaw_deg)
        with self._monkeypatch.context() as patch:
            if options:
                patch.setattr("omnisim.sensors.renderer.CubePass", partial(CubePass, **options))
            if worth is not None:
                turns = len(cluster_culling.OCCLUDERS_RAD)
                patch.setattr(cluster_culling, "WORTH_A_TURN", (worth,) * turns)
            if shows_hidden:
                patch.setattr(HiZ, "hides", lambda _, boxes: np.zeros_like(boxes.nearest, bool))
            with Renderer(self._stage, camera) as renderer:
                rgba = renderer.render(world_from_base).rgba
                if not options:
                    self.triangles = renderer._passes.cube._static.triangles
        return rgba


def assert_same(one, other):
    """The same picture, but for rounding."""
    assert np.array_equal(one[..., 3], other[..., 3])
    inside = one[..., 3] > 0
    off = one[inside, :3].astype(float) - other[inside, :3]
    assert np.mean(np.abs(off).max(axis=-1) > 1.0) < MOST_OTHER
    assert 10.0 * np.log10(255.0**2 / max(np.mean(off**2), 1e-9)) > LEAST_DB


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("source", ["soccer", "mapping", "warehouse"])
def test_scenes_look_as_if_drawn_plainly(source, monkeypatch, request):
    scene = load_scene(request.getfixturevalue(source) if source == "warehouse" else source)
    with Stage(scene) as stage:
        pictures = Pictures(monkeypatch, stage)
        usual = pictures.take()
        assert_same(usual, pictures.take(plain=True))
        # what is hidden is hidden, to the last bit
        assert np.array_equal(usual, pictures.take(worth=ALWAYS))
        assert np.array_equal(usual, pictures.take(worth=NEVER))


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("lamps", [(SUN, LAMP), (SUN,)], ids=["a lamp near by", "the sun alone"])
@pytest.mark.parametrize("samples", [1, 4])
def test_materials_dynamic_objects_and_mirrored_instances_look_as_if_drawn_plainly(
    samples, lamps, monkeypatch
):
    camera = dataclasses.replace(FAST.resized(200), samples=samples)
    with Stage(mixed_scene(*lamps), dynamic_object()) as stage:
        pictures = Pictures(monkeypatch, stage, camera)
        for at in ((0.0, 0.0, 0.0), (0.4, -0.3, 0.2)):
            pose = make_pose(at, roll_deg=5.0, yaw_deg=40.0) @ np.linalg.inv(camera.base_from_rig)
            plain = pictures.take(pose, plain=True)
            usual = pictures.take(pose, worth=NEVER)
            assert_same(usual, plain)
            assert np.array_equal(usual, pictures.take(pose, worth=ALWAYS))
            # there is something to see: not everything is one colour
            assert plain[..., :3].std(axis=(0, 1)).min() > 20.0


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("samples", [1, 4])
def test_only_depth_of_one_sample_is_read(samples, monkeypatch):
    """OpenGL gives nothing else back, and leaves in memory what was there before."""
    reads, read_depth = [], CubePass._read_depth

    def noted(cube):
        reads.append(cube)
        return read_depth(cube)

    monkeypatch.setattr(CubePass, "_read_depth", noted)
    camera = dataclasses.replace(FAST.resized(60), samples=samples)
    with Stage(mixed_scene()) as stage:
        Pictures(monkeypatch, stage, camera).take(worth=ALWAYS)
    # before each turn but the first
    assert len(reads) == (len(cluster_culling.OCCLUDERS_RAD) if samples == 1 else 0)


@pytest.mark.usefixtures("needs_opengl")
def test_what_is_left_out_was_hidden_to_the_last_bit(monkeypatch):
    """In as many turns, with all that is hidden and without; and drawn plainly."""
    camera = FAST.resized(240)
    with Stage(crowd()) as stage:
        pictures = Pictures(monkeypatch, stage, camera)
        for at in ((0.0, 0.0, 0.0), (-3.0, 2.0, 0.5), (0.4, 5.0, -0.5)):
            pose = make_pose(at, roll_deg=4.0, yaw_deg=70.0) @ np.linalg.inv(camera.base_from_rig)
            some = pictures.take(pose, worth=ALWAYS)
            drawn = pictures.triangles
            everything = pictures.take(pose, worth=ALWAYS, shows_hidden=True)
            assert np.array_equal(some, everything)
            assert drawn < 0.8 * pictures.triangles
            assert_same(some, pictures.take(pose, plain=True))


@pytest.mark.usefixtures("needs_opengl")
def test_a_picture_does_not_depend_on_the_one_before(monkeypatch):
    monkeypatch.setattr(cluster_culling, "WORTH_A_TURN", (0, 0))
    camera = FAST.resized(100)
    poses = [make_pose((x, 0.5 * x, 0.0), yaw_deg=90.0 * x) for x in (0.0, 4.0, -5.0)]
    with Stage(crowd()) as stage:
        alone = []
        for pose in poses:
            with Renderer(stage, camera) as renderer:
                alone.append(renderer.render(pose).rgba)
        with Renderer(stage, camera) as renderer:
            for number in (0, 1, 0, 2, 1, 2):
                assert np.array_equal(renderer.render(poses[number]).rgba, alone[number])
