"""Geometry drawn by clusters, beside instances drawn one after the other, whole."""

import dataclasses
from functools import partial

import numpy as np
import pytest

from omnisim.core.poses import pose as make_pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl import scene_view
from omnisim.rendering.opengl.culling import triangle_culling
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.stage import Stage
from omnisim.scene import load_scene
from tests.rendering.opengl.commands import count_triangles, show_occluded
from tests.rendering.opengl.sheets import LAMP, SUN, crowd, dynamic_object, mixed_scene
from tests.scenes import with_warehouse

FAST = OmniCamera().with_quality("fast")
ALWAYS, NEVER = 0, 10**9  # triangles that have to be left for another pass
# Matrices are multiplied in another order, and float32 rounds otherwise. A color half-way between
# two steps of 8 bits then takes the other one: a step in up to 1 % of the pixels, 68 dB. And where
# two surfaces have the same depth, another one may be in front, or the edge of a triangle takes its
# own normal for facing away: in a pixel of ten thousand.
MIN_DB = 65.0
MAX_OTHER = 1e-4


def reference_stage(monkeypatch, *scenes):
    """A stage that draws instance after instance, whole."""
    with monkeypatch.context() as patch:
        buffers = partial(SceneBuffers, uses_clusters=False)
        patch.setattr("omnisim.rendering.opengl.cube_backend.SceneBuffers", buffers)
        return Stage(*scenes)


class Images:
    """Images of a stage, by other limits of culling.

    Attributes:
        triangles: of the static geometry, submitted for the last one.
    """

    def __init__(self, monkeypatch, stage, camera=FAST):
        self._monkeypatch, self._stage, self._camera = monkeypatch, stage, camera
        self.triangles = 0

    def take(self, world_from_base=None, min_triangles=None, shows_occluded=False):
        camera, start = self._camera, self._stage.scene.start
        if world_from_base is None:
            world_from_base = camera.base_pose(start.position_m, yaw_deg=start.yaw_deg)
        with self._monkeypatch.context() as patch:
            if min_triangles is not None:
                patch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (min_triangles,) * 4)
                patch.setattr(scene_view, "MIN_CULLED_TRIANGLES", min_triangles)
            with self._stage.open(camera) as renderer:
                culler = renderer._passes.cube.tiles.culler
                if shows_occluded:
                    show_occluded(culler)
                submitted = [] if culler is None else count_triangles(culler)
                rgba = renderer.render(world_from_base).rgba
                self.triangles = sum(submitted)
        return rgba


def assert_same(one, other):
    """The same image, but for rounding."""
    assert np.array_equal(one[..., 3], other[..., 3])
    inside = one[..., 3] > 0
    off = one[inside, :3].astype(float) - other[inside, :3]
    assert np.mean(np.abs(off).max(axis=-1) > 1.0) < MAX_OTHER
    assert 10.0 * np.log10(255.0**2 / max(np.mean(off**2), 1e-9)) > MIN_DB


@pytest.mark.usefixtures("needs_opengl")
@with_warehouse("soccer", pytest.param("mapping", marks=pytest.mark.slow))
def test_scenes_look_as_if_drawn_one_by_one(source, monkeypatch):
    scene = load_scene(source)
    with Stage(scene) as stage, reference_stage(monkeypatch, scene) as reference:
        images = Images(monkeypatch, stage)
        clustered = images.take()
        assert_same(clustered, Images(monkeypatch, reference).take())
        # what is occluded is hidden, to the last bit
        assert np.array_equal(clustered, images.take(min_triangles=ALWAYS))
        assert np.array_equal(clustered, images.take(min_triangles=NEVER))


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(("samples", "lights"), [(1, (SUN, LAMP)), (4, (SUN,))])
def test_materials_dynamic_objects_and_mirrored_instances_look_as_if_drawn_one_by_one(
    samples, lights, monkeypatch
):
    camera = dataclasses.replace(FAST.resized(200), samples=samples)
    scenes = mixed_scene(*lights), dynamic_object()
    with Stage(*scenes) as stage, reference_stage(monkeypatch, *scenes) as reference:
        images = Images(monkeypatch, stage, camera)
        one_by_one = Images(monkeypatch, reference, camera)
        for at in ((0.0, 0.0, 0.0), (0.4, -0.3, 0.2)):
            pose = make_pose(at, roll_deg=5.0, yaw_deg=40.0) @ np.linalg.inv(camera.base_from_rig)
            expected = one_by_one.take(pose)
            clustered = images.take(pose, min_triangles=NEVER)
            assert_same(clustered, expected)
            assert np.array_equal(clustered, images.take(pose, min_triangles=ALWAYS))
            # there is something to see: not everything is one color
            assert expected[..., :3].std(axis=(0, 1)).min() > 20.0


@pytest.mark.usefixtures("needs_opengl")
def test_occluded_clusters_were_hidden_to_the_last_bit(monkeypatch):
    """In as many passes, with occluded clusters and without; and drawn one by one."""
    camera, scene = FAST.resized(240), crowd()
    with Stage(scene) as stage, reference_stage(monkeypatch, scene) as reference:
        images = Images(monkeypatch, stage, camera)
        for at in ((0.0, 0.0, 0.0), (0.4, 5.0, -0.5)):
            pose = make_pose(at, roll_deg=4.0, yaw_deg=70.0) @ np.linalg.inv(camera.base_from_rig)
            some = images.take(pose, min_triangles=ALWAYS)
            drawn = images.triangles
            everything = images.take(pose, min_triangles=ALWAYS, shows_occluded=True)
            assert np.array_equal(some, everything)
            assert drawn < 0.8 * images.triangles
            assert_same(some, Images(monkeypatch, reference, camera).take(pose))


@pytest.mark.usefixtures("needs_opengl")
def test_triangles_beyond_the_room_are_drawn_with_their_clusters(monkeypatch):
    monkeypatch.setattr(scene_view, "MIN_CULLED_TRIANGLES", 0)
    images, submitted = [], []
    for room in (0, 60, triangle_culling.MAX_ROOM):
        monkeypatch.setattr(triangle_culling, "MAX_ROOM", room)
        with Stage(crowd()) as stage, stage.open(FAST.resized(100)) as renderer:
            drawn = count_triangles(renderer._passes.cube.tiles.culler)
            images.append(renderer.render(np.eye(4)).rgba)
        submitted.append(sum(drawn))
    assert submitted[0] > submitted[1] > submitted[2]
    for image in images[1:]:
        assert np.array_equal(image, images[0])


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("min_culled_triangles", [0, 10**9])
def test_an_image_does_not_depend_on_the_one_before(monkeypatch, min_culled_triangles):
    monkeypatch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (0, 0, 0, 0))
    monkeypatch.setattr(scene_view, "MIN_CULLED_TRIANGLES", min_culled_triangles)
    camera = FAST.resized(100)
    poses = [make_pose((x, 0.5 * x, 0.0), yaw_deg=90.0 * x) for x in (0.0, 4.0, -5.0)]
    with Stage(crowd()) as stage:
        alone = []
        for pose in poses:
            with stage.open(camera) as renderer:
                alone.append(renderer.render(pose).rgba)
        with stage.open(camera) as renderer:
            for number in (0, 1, 0, 2, 1, 2):
                assert np.array_equal(renderer.render(poses[number]).rgba, alone[number])
