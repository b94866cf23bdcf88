"""Edits of a scene on the GPU, against a fresh renderer of the edited scene."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import SceneError
from omnisim.core.poses import pose
from omnisim.rendering.atlas.tile_plan import sensor_tiles, whole_faces
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.camera_frame import CubePass
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.surfaces.surface_program import SurfacePrograms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.shared_scene import EditableScene
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.scene import Scene
from omnisim.sensors import LaserScanner
from tests.rendering.frames import frame_of
from tests.rendering.opengl.sheets import sheet
from tests.scenes import square
from tests.slow import slow_but
from tests.vehicles import box as box_mesh

CHANNELS = ("range", "position", "normals", "albedo", "semantic", "instance")
LENS = EquidistantCamera(96, 96, 30.0, (47.5, 47.5), theta_max_rad=1.6)
HERE = pose((0.0, 0.0, 1.0))
BARS = np.where(np.arange(8) % 4 == 3, 0, 255).astype(np.uint8)  # of a fence


def box(name="box", half_m=0.4, **options):
    """Box with corners of its own at each face, so that it has texture coordinates."""
    mesh = box_mesh(name, 0, half_m)
    options["uv"] = mesh.texture_coordinates
    return Scene.from_arrays(name, mesh.positions, mesh.triangles, **options)


def fence():
    pixels = np.full((8, 8, 4), 180, np.uint8)
    pixels[..., 3] = BARS
    return pixels


def yard():
    """Ground with boxes: opaque ones that share a mesh, a masked and a blended one."""
    corners, triangles = square(9.0).positions, square(9.0).triangles
    green = {"base_color": (0.2, 0.5, 0.2), "double_sided": False}
    scene, plain = Scene.from_arrays("ground", corners, triangles, **green), box()
    for number, angle in enumerate(np.arange(0, 360, 60)):
        turned = pose(yaw_deg=angle) @ pose((2.0 + 0.3 * number, 0.0, 0.4))
        scene = scene.added(f"box_{number}", plain, turned)
    scene = scene.added(
        "fence", box(texture=fence()), pose((1.2, 1.2, 0.8), roll_deg=10, pitch_deg=20, yaw_deg=17)
    )
    return scene.added("glass", box(base_color=(0, 0, 1, 0.6)), pose((1.0, -1.0, 0.6)))


ELSEWHERE = pose((-1.0, 0.2, 1.1), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0)
EDITS = {
    "move": lambda one: one.move("box_1", ELSEWHERE),
    "move a masked one": lambda one: one.move("fence", ELSEWHERE),
    "move a blended one": lambda one: one.move("glass", ELSEWHERE),
    "remove": lambda one: one.remove("box_5"),
    "recolor": lambda one: one.recolor("box_1", (0.9, 0.1, 0.0)),
    "clear": lambda one: one.recolor("box_1", (0.9, 0.1, 0.0, 0.3)),
    "texture": lambda one: one.recolor("box_1", (1.0, 1.0, 0.0), fence()),
    "opaque": lambda one: one.recolor("glass", (0.9, 0.1, 0.0)),
    "add": lambda one: one.add("ball", box(half_m=0.2, colors=np.eye(24, 3)), pose((1.5, 0, 1))),
    "add glass": lambda one: one.add("pane", box(base_color=(1, 1, 0, 0.5)), pose((1.5, 0, 1))),
}


def draw(renderer):
    return renderer.render(HERE, linear=True, also=CHANNELS)


def assert_same(frame, expected):
    """Equal but for baked light, and for what is rounded at silhouettes."""
    difference = np.abs(frame.rgb.astype(int) - expected.rgb).max(axis=-1)
    assert (difference > 1).mean() < 2e-3
    for name in CHANNELS:
        ours, theirs = frame.channels[name], expected.channels[name]
        same = np.isclose(ours, theirs, rtol=1e-4, atol=1e-4, equal_nan=True)
        assert same.reshape(96, 96, -1).all(axis=-1).mean() > 1 - 2e-3, name
    assert [
        (instance.id, instance.name, instance.class_id) for instance in frame.labels.instances
    ] == [(instance.id, instance.name, instance.class_id) for instance in expected.labels.instances]


@pytest.mark.parametrize("name", slow_but(EDITS, "move", "clear", "texture", "opaque", "add"))
def test_the_next_frame_is_that_of_a_fresh_renderer(name):
    with open_sensor(yard(), LENS) as renderer:
        before = draw(renderer)
        EDITS[name](renderer)
        frame = draw(renderer)
        with open_sensor(renderer.scene, LENS) as fresh:
            assert_same(frame, draw(fresh))
    changed = (frame.rgb != before.rgb).any(axis=-1)
    assert changed.sum() > 20


def test_many_edits_are_as_good_as_one():
    rng = np.random.default_rng(5)
    scene, part = yard(), box(half_m=0.15, base_color=(0.8, 0.2, 0.6))
    with open_sensor(scene, LENS) as renderer:
        before = draw(renderer)
        for step in range(30):
            names = renderer.scene.instance_names
            name = str(rng.choice(names[1:]))
            at, (roll_deg, yaw_deg) = rng.uniform((-2, -2, 0), (2, 2, 2)), rng.uniform(0, 360, 2)
            place = pose(at, roll_deg=roll_deg, yaw_deg=yaw_deg)
            kind = rng.integers(4)
            if kind == 0:
                renderer.add(f"new_{step}", part, place)
            elif kind == 1 and len(names) > 6:
                renderer.remove(name)
            elif kind == 2:
                renderer.recolor(name, rng.uniform(0, 1, rng.integers(3, 5)))
            else:
                renderer.move(name, place)
            if step % 7 == 0:
                draw(renderer)
        frame = draw(renderer)
        with open_sensor(renderer.scene, LENS) as fresh:
            assert_same(frame, draw(fresh))
        renderer.scene = scene
        after = draw(renderer)
    # nothing of the edits is left
    np.testing.assert_array_equal(after.linear, before.linear)
    for name in CHANNELS:
        np.testing.assert_array_equal(after.channels[name], before.channels[name])


def _drawn(cube):
    cube.draw((ScenePoses(HERE),))
    return cube.atlas.read()


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_items_drawn_one_by_one_are_equal_byte_for_byte(context, edit):
    class Holder(EditableScene):
        scene = yard()
        _moving = ()

    sensor = OmniCamera.of(LENS)
    plan = whole_faces(sensor_tiles(sensor, LENS, 1.0))
    cameras = VirtualCameras(0.1, np.inf, 1)

    def cube(buffers):
        programs = SurfacePrograms(buffers, Holder.scene.lighting)
        return CubePass(buffers, programs, plan, cameras)

    buffers = SceneBuffers(context, Holder.scene, uses_clusters=False)
    edited = cube(buffers)
    _drawn(edited)
    holder = Holder()
    edit(holder)
    buffers.update(holder.scene)
    edited.refresh()
    frame = _drawn(edited)
    fresh = cube(SceneBuffers(context, holder.scene, uses_clusters=False))
    assert frame == _drawn(fresh)


def test_all_renderers_of_a_stage_see_an_edit():
    with Stage(yard()) as stage:
        eye, other = stage.open(LENS), stage.open(LENS)
        laser = stage.open(LaserScanner())
        scanner = pose((0.0, 0.0, 0.4))
        before, ranges = other.render(HERE), laser.scan(scanner).ranges_m
        eye.move("box_0", pose((0.0, -1.5, 0.4)))
        assert stage.scene is eye.scene is other.scene
        assert (other.render(HERE).rgb != before.rgb).any()
        moved = laser.scan(scanner).ranges_m
    with open_sensor(stage.scene, LaserScanner()) as fresh:
        np.testing.assert_allclose(moved, fresh.scan(scanner).ranges_m, atol=1e-5)
    assert (moved != ranges).sum() > 5


def test_what_an_edit_moves_has_no_flow():
    with open_sensor(yard(), LENS) as renderer:
        draw(renderer)
        renderer.move("box_0", pose((1.0, 0.5, 1.0)))
        flow = renderer.render(HERE, also=("flow",), next_state=HERE).channels["flow"]
        expected = frame_of(renderer.scene, LENS, HERE, also=("flow",), next_state=HERE)
    np.testing.assert_allclose(flow, expected.channels["flow"], atol=1e-3)


def test_a_scene_may_be_empty_for_a_while():
    part = box()
    with open_sensor(part, LENS) as renderer:
        draw(renderer)
        renderer.remove("box")
        frame = draw(renderer)
        assert not frame.channels["instance"].any()
        with open_sensor(renderer.scene, LENS) as fresh:
            np.testing.assert_array_equal(draw(fresh).rgb, frame.rgb)
            fresh.add("box", part, pose((1.0, 0.0, 1.0)))
            found = draw(fresh)
    assert found.channels["instance"].any()


@pytest.mark.slow
@pytest.mark.long
def test_memory_is_bounded():
    with open_sensor(yard(), LENS) as renderer:
        draw(renderer)
        buffers = renderer._stage.graphics.buffers
        sizes = []
        for number in range(60):
            texture, mesh = np.full((16, 16, 3), number, np.uint8), sheet("part", 0, side=49)
            uv = mesh.texture_coordinates
            part = Scene.from_arrays("part", mesh.positions, mesh.triangles, uv=uv, texture=texture)
            renderer.add("part", part, pose((1.5, 0.0, 0.01 * number)))
            frame = draw(renderer) if number % 20 == 19 else renderer.render(HERE)
            sizes.append(buffers.vertices.size + buffers.indices.size)
            assert len(buffers.draw_items) <= 12
            assert len(buffers._textures._layers) <= 4
            if number < 59:
                renderer.remove("part")
        assert max(sizes) < 40_000_000
        assert sizes[-1] <= max(sizes[:40])
        with open_sensor(renderer.scene, LENS) as fresh:
            assert_same(frame, draw(fresh))


def test_frames_without_edits_refresh_nothing(monkeypatch):
    with open_sensor(yard(), LENS) as renderer:
        renderer.move("box_0", pose((1.0, 0.0, 1.0)))
        renderer.move("box_0", pose((1.0, 0.0, 2.0)))
        calls, refresh = [], CubePass.refresh
        monkeypatch.setattr(CubePass, "refresh", lambda one: (calls.append(one), refresh(one)))
        for _ in range(3):
            renderer.render(HERE)
    assert len(calls) == 1  # both edits at once, in the first frame


def test_another_world_is_refused():
    body = Scene.from_arrays("body", np.eye(3), [[0, 1, 2]])
    with open_sensor(yard(), LENS, body=body) as renderer:
        before = renderer.render(HERE)
        with pytest.raises(SceneError, match="scene: expected the background"):
            renderer.scene = dataclasses.replace(yard(), background=(1.0, 0.0, 0.0))
        with pytest.raises(SceneError, match="scene: expected a Scene, got str"):
            renderer.scene = "courtyard"
        with pytest.raises(SceneError, match="instance 'bx_0': unknown; did you mean"):
            renderer.move("bx_0", HERE)
        with pytest.raises(SceneError, match=r"moves with the state of each frame: .*WorldState"):
            renderer.move("body", HERE)
        np.testing.assert_array_equal(renderer.render(HERE).rgb, before.rgb)


@pytest.mark.slow
def test_rays_see_edits_too():
    pytest.importorskip("embreex")
    with open_sensor(yard(), LENS, backend="rays") as renderer:
        draw(renderer)
        for edit in EDITS.values():
            edit(renderer)
            renderer.scene = yard() if "glass" in renderer.scene.instance_names else renderer.scene
        renderer.move("box_1", ELSEWHERE)
        frame = draw(renderer)
        with open_sensor(renderer.scene, LENS, backend="rays") as fresh:
            expected = draw(fresh)
    np.testing.assert_array_equal(frame.linear, expected.linear)
    for name in CHANNELS:
        np.testing.assert_array_equal(frame.channels[name], expected.channels[name])
