"""Blended surfaces drawn at once, beside items drawn one after the other."""

import dataclasses

import numpy as np
import pytest
import trimesh

from omnisim.core.poses import pose as make_pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.surfaces import cluster_drawer
from omnisim.rendering.stage import Stage
from omnisim.scene.model import AlphaMode, Lighting, Material, Mesh, Texture, Wrap
from tests.rendering.opengl.sheets import LAMP, SUN, sheet
from tests.rendering.opengl.surfaces.test_cluster_drawer import assert_same, reference_stage
from tests.scenes import room, scene_of

CAMERA = OmniCamera().with_quality("fast").resized(120)


def _texture(size, wrap=Wrap.REPEAT):
    generator = np.random.default_rng(size)
    return Texture(generator.integers(40, 256, (size, size, 4), dtype=np.uint8), wrap, wrap)


def _glass(**options):
    return Material(base_color=(0.7, 0.8, 0.9, 0.6), alpha_mode=AlphaMode.BLEND, **options)


MATERIALS = [
    Material("room", double_sided=True),
    _glass(),
    _glass(double_sided=True),
    _glass(texture=_texture(8), double_sided=True),
    _glass(texture=_texture(16), unlit=True),
    _glass(texture=_texture(16, Wrap.CLAMP_TO_EDGE), double_sided=True, unlit=True),
]


def _scene(*lights):
    """Sheets of every material behind each other, some of them mirrored."""
    generator = np.random.default_rng(3)
    meshes, poses = [room()], [np.eye(4)]
    for number in range(20):
        kind = 1 + number % (len(MATERIALS) - 1)
        meshes.append(sheet(f"sheet {number}", kind, seed=number, up=(None, 0.3)[number % 2]))
        at = generator.uniform((-2.5, -1.6, -1.2), (2.5, 1.6, 0.6))
        at *= max(1.0, 1.0 / np.linalg.norm(at))
        roll_deg, pitch_deg, yaw_deg = generator.uniform(0.0, 360.0, 3)
        pose = make_pose(at, roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)
        if number % 3 == 0:
            pose[:3, :3] = pose[:3, :3] @ np.diag((1.0, -0.8, 1.2))
        poses.append(pose)
    return scene_of(meshes, MATERIALS, poses, lighting=Lighting((0.2, 0.2, 0.3), lights))


def _body():
    """Panes beside the camera, which move with it."""
    poses = [
        make_pose((0.3, 0.6, 0.1), roll_deg=80.0),
        make_pose((-0.5, 0.4, 0.2), roll_deg=70.0, pitch_deg=20.0),
    ]
    return scene_of([sheet("pane", 3), sheet("window", 1, seed=2)], MATERIALS, poses)


POSES = [make_pose((0.1 * n, 0.2 - 0.2 * n, -0.3), yaw_deg=80.0 * n) for n in range(3)]


def _take(stage, unlit=False):
    with stage.open(CAMERA, unlit=unlit) as renderer:
        drawer = renderer._passes.cube._view.blended_drawer
        return drawer, [renderer.render(pose).rgba for pose in POSES]


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(("lights", "unlit"), [((SUN, LAMP), False), ((SUN,), True)])
def test_they_look_as_if_drawn_one_by_one(lights, unlit, monkeypatch):
    scenes = _scene(*lights), _body()
    with Stage(*scenes) as stage, reference_stage(monkeypatch, *scenes) as reference:
        drawer, images = _take(stage, unlit)
        none, expected = _take(reference, unlit)
        assert drawer is not None
        assert none is None
        for ours, theirs in zip(images, expected, strict=True):
            assert_same(ours, theirs)
        again = _take(stage, unlit)[1]
        assert all(map(np.array_equal, images, again))


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("limit", ["MAX_ARRAYS", "MAX_TRIANGLES_OF_ITEM", "MAX_ITEMS"])
def test_too_many_are_drawn_one_by_one(limit, monkeypatch):
    with Stage(_scene(SUN)) as stage:
        with stage.open(CAMERA) as renderer:
            expected = renderer.render(POSES[0]).rgba
        monkeypatch.setattr(cluster_drawer, limit, 1)
        with stage.open(CAMERA) as renderer:
            assert renderer._passes.cube._view.blended_drawer is None
            assert_same(renderer.render(POSES[0]).rgba, expected)


def _in_a_bulb():
    """The body, with a closed surface of glossy glass around the camera, which no drawer sorts."""
    body, ball = _body(), trimesh.creation.icosphere(subdivisions=1, radius=0.2)
    bulb = Mesh("bulb", ball.vertices.astype(np.float32), ball.faces.astype(np.uint32), 6)
    materials = [*MATERIALS, _glass(specular=1.0, roughness=0.1)]
    meshes, poses = [*body.meshes, bulb], [instance.world_from_mesh for instance in body.instances]
    return scene_of(meshes, materials, [*poses, np.eye(4)])


@pytest.mark.usefixtures("needs_opengl")
def test_others_that_turn_away_leave_the_sorting_to_the_gpu():
    with Stage(_scene(SUN), _body()) as stage, stage.open(CAMERA) as renderer:
        expected = [renderer.render(pose).rgba for pose in POSES]
    colors = [one[..., :3] for one in expected]
    with Stage(_scene(SUN), _in_a_bulb()) as stage, stage.open(CAMERA) as renderer:
        cube = renderer._passes.cube
        images = [renderer.render(pose).rgba for pose in POSES]
        assert all(map(np.array_equal, images, expected))
        assert all(cube._view.sorts_blended(ScenePoses(pose, [pose])) for pose in POSES)
        batch = renderer.render_batch(np.stack(POSES))
        assert renderer._passes.batches._reserved.layers.drawn is not None
        assert all(map(np.array_equal, batch, colors))


@pytest.mark.usefixtures("needs_opengl")
def test_others_in_view_are_drawn_one_by_one_with_the_rest(monkeypatch):
    scenes = _scene(SUN, LAMP), _in_a_bulb()
    camera = dataclasses.replace(CAMERA, base_from_rig=make_pose((-0.4, -0.3, 0.1)))
    with Stage(*scenes) as stage, reference_stage(monkeypatch, *scenes) as reference:
        with stage.open(camera) as renderer:
            images = [renderer.render(pose).rgba for pose in POSES]
            batch = renderer.render_batch(np.stack(POSES))
            assert renderer._passes.batches._reserved.layers.drawn is None
        with reference.open(camera) as renderer:
            for image, also, pose in zip(images, batch, POSES, strict=True):
                assert_same(image, renderer.render(pose).rgba)
                np.testing.assert_array_equal(image[..., :3], also)


@pytest.mark.usefixtures("needs_opengl")
def test_all_may_be_mirrored():
    """A pane that an instance mirrors looks like one whose vertices are mirrored."""
    pose, mirror = make_pose((1.0, 0.0, 0.0), pitch_deg=70.0), np.diag((1.0, -1.0, 1.0, 1.0))
    pane = sheet("pane", 1)
    turned = dataclasses.replace(
        pane,
        positions=pane.positions * np.float32((1.0, -1.0, 1.0)),
        triangles=np.ascontiguousarray(pane.triangles[:, ::-1]),
        normals=None if pane.normals is None else pane.normals * np.float32((1.0, -1.0, 1.0)),
    )
    images = []
    for mesh, placed in ((pane, pose @ mirror), (turned, pose)):
        poses = [np.eye(4), placed]
        scene = scene_of([room(), mesh], MATERIALS, poses, lighting=Lighting((0.5,) * 3, ()))
        with Stage(scene) as stage, stage.open(CAMERA) as renderer:
            images.append(renderer.render(POSES[0]).rgba)
    assert_same(*images)
