"""SAPIEN: what its rays hit, how its links move, and its shapes, lights and textures."""

import gc
import importlib
import sys

import numpy as np
import pytest

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import NoticeWarning, OmnisimError, SceneError
from omnisim.follow import SapienStage
from omnisim.scene import primitives
from omnisim.scene.model import LightKind

sapien = pytest.importorskip("sapien")
pytestmark = pytest.mark.usefixtures("needs_opengl")
SIZE = 96
LENS = EquidistantCamera(SIZE, SIZE, 29.0, ((SIZE - 1) / 2, (SIZE - 1) / 2), 1.6)
KNOT = primitives.box((0.3, 0.2, 0.1))
REACH_M = 60.0


def new_scene():
    """Scene without a renderer, which needs no Vulkan."""
    return sapien.Scene([sapien.physx.PhysxCpuSystem()])


@pytest.fixture
def rendered():
    """Scene with a renderer."""
    for device in ("cuda", "pci:0"):  # the second one is Mesa's lavapipe
        try:
            render = sapien.render.RenderSystem(sapien.Device(device))
        except RuntimeError:
            continue
        return sapien.Scene([sapien.physx.PhysxCpuSystem(), render])
    pytest.skip("SAPIEN finds no Vulkan device")


def add_arm(scene, name="arm"):
    """Robot of three links on two joints, whose centers of mass are not their origins."""
    builder = scene.create_articulation_builder()
    base = builder.create_link_builder()
    base.set_name("base")
    base.add_box_collision(half_size=(0.2, 0.3, 0.1))
    upper = builder.create_link_builder(base)
    upper.set_name("upper")
    upper.add_capsule_collision(sapien.Pose((0.3, 0.0, 0.0)), radius=0.08, half_length=0.2)
    hand = builder.create_link_builder(upper)
    hand.set_name("hand")
    hand.add_cylinder_collision(sapien.Pose((0.1, 0.0, 0.0)), radius=0.12, half_length=0.05)
    hand.add_sphere_collision(sapien.Pose((0.2, 0.1, 0.0)), radius=0.07)
    for link, at in ((upper, (0.1, 0.0, 0.2)), (hand, (0.6, 0.0, 0.0))):
        link.set_joint_name(f"to_{link.name}")
        pose = sapien.Pose(at, (0.707107, 0.0, 0.707107, 0.0))
        link.set_joint_properties("revolute", ((-2.0, 2.0),), pose, sapien.Pose())
    arm = builder.build()
    arm.name = name
    return arm


def add_things(scene):
    """One entity of each shape that collides."""
    build = {
        "box": lambda one: one.add_box_collision(half_size=(0.1, 0.2, 0.3)),
        "ball": lambda one: one.add_sphere_collision(radius=0.2),
        "pill": lambda one: one.add_capsule_collision(radius=0.1, half_length=0.2),
        "can": lambda one: one.add_cylinder_collision(radius=0.2, half_length=0.1),
    }
    entities = []
    for name, add in build.items():
        entities.append(add(scene.create_actor_builder()).build_kinematic(name))
    material = sapien.physx.get_default_material()
    for kind in ("Convex", "Triangle"):
        body = sapien.physx.PhysxRigidDynamicComponent()
        body.kinematic = True
        mesh = getattr(sapien.physx, f"PhysxCollisionShape{kind}Mesh")
        triangles = [] if kind == "Convex" else [KNOT.triangles.astype(np.uint32)]
        body.attach(mesh(KNOT.positions.astype(np.float32), *triangles, (1, 2, 1), material))
        entity = sapien.Entity()
        entity.add_component(body)
        scene.add_entity(entity)
        entities.append(entity)
    return entities


def hits_of(scene, frame):
    """Ranges (height, width) of SAPIEN's rays along a frame's pixels, and the entities hit."""
    world_from_optical = np.array(frame.metadata["world_from_optical"])
    rays = LENS.ray_from_pixel(pixel_grid(SIZE, SIZE)).directions @ world_from_optical[:3, :3].T
    origin = world_from_optical[:3, 3]
    rows = rays.reshape(-1, 3)
    hits = [scene.physx_system.raycast(origin, row, REACH_M) for row in rows]
    order = {entity.per_scene_id: index for index, entity in enumerate(scene.entities)}
    ids = [-1 if hit is None else order[hit.component.entity.per_scene_id] for hit in hits]
    ranges_m = np.array([np.inf if hit is None else hit.distance for hit in hits])
    return ranges_m.reshape(SIZE, SIZE), np.array(ids).reshape(SIZE, SIZE)


def inner(ids):
    """Pixels whose four neighbors show the same body."""
    same = np.zeros(ids.shape, dtype=bool)
    middle = ids[1:-1, 1:-1]
    neighbors = ids[:-2, 1:-1], ids[2:, 1:-1], ids[1:-1, :-2], ids[1:-1, 2:]
    same[1:-1, 1:-1] = np.all([middle == other for other in neighbors], axis=0)
    return same


def some_pose(rng, spread_m=1.5):
    turn = rng.normal(size=4)
    at = (*rng.uniform(-spread_m, spread_m, 2), rng.uniform(0.5, 1.2))
    return sapien.Pose(at, turn / np.linalg.norm(turn))


@pytest.mark.slow
def test_shapes_are_where_sapiens_rays_hit_them():
    scene, rng = new_scene(), np.random.default_rng(1)
    scene.add_ground(0.0, render=False)
    arm, things = add_arm(scene), add_things(scene)
    scene.timestep = 1e-6
    errors, is_same = [], []
    with SapienStage(scene) as stage:
        assert stage.names[:4] == ("ground", "arm/base", "arm/upper", "arm/hand")
        assert stage.names[-2:] == ("entity", "entity_2")
        camera = stage.open(LENS)
        for _ in range(10):
            arm.set_root_pose(some_pose(rng))
            arm.set_qpos(rng.uniform(-1.5, 1.5, 2).astype(np.float32))
            for entity in things:
                entity.pose = some_pose(rng)
            scene.step()  # rays hit links where the last step has left them
            at = (*rng.uniform(-0.5, 0.5, 2), rng.uniform(0.3, 1.5))
            eye = omnisim.pose(at, yaw_deg=rng.uniform(0, 360), pitch_deg=rng.uniform(-20, 40))
            state = stage.now().moved({camera.vehicle: eye})
            frame = camera.render(state, also=("range", "instance"))
            ranges_m, hit_ids = hits_of(scene, frame)
            ids = stage.body_ids(frame)
            chosen = frame.valid & inner(ids) & inner(hit_ids)
            is_same.append((ids == hit_ids)[chosen])
            chosen &= np.isfinite(ranges_m) & np.isfinite(frame.channels["range"])
            errors.append(np.abs(frame.channels["range"][chosen] - ranges_m[chosen]))
    errors_m = np.concatenate(errors)
    assert (errors_m < 1e-3).mean() > 0.999
    assert np.concatenate(is_same).mean() > 0.999


def test_velocities_are_those_of_the_links_origins():
    scene = new_scene()
    arm = add_arm(scene)
    scene.timestep = step_s = 1e-4
    arm.set_qvel(np.array([1.0, -2.0], np.float32))
    arm.set_root_linear_velocity((1.0, 0.5, 0.0))
    arm.set_root_angular_velocity((0.5, 2.0, -1.0))
    with SapienStage(scene) as stage:
        scene.step()
        before = stage.now(0.2)
        scene.step()
        motion = stage.motion_now(0.2 + step_s)
        back = motion(0.2)
    assert back.time_s == before.time_s == 0.2
    for name, pose in before.world_from_object.items():
        # a meter per second is 0.1 mm; poses of float32 and accelerations, far less
        np.testing.assert_allclose(back.world_from_object[name], pose, atol=5e-6, err_msg=name)


def test_scenes_are_worlds_of_a_batch():
    scenes = [new_scene(), new_scene()]
    for scene in scenes:
        scene.add_ground(0.0, render=False)
    with SapienStage(scenes) as stage:
        camera = stage.open(LENS, omnisim.pose((0.0, 0.0, 1.0), pitch_deg=90.0))
        scenes[1].entities[0].pose = sapien.Pose((0.0, 0.0, -0.5))
        states = stage.worlds_now(0.5)
        ranges_m = camera.render_batch(states, channels=("range",))["range"]
        np.testing.assert_allclose(ranges_m[:, SIZE // 2, SIZE // 2], (1.0, 1.5), atol=1e-3)
        assert states[1].time_s == stage.now(0.5).time_s == 0.5
    add_arm(scenes[1])
    with pytest.raises(SceneError, match="scenes: expected 1 entities in each, got 4"):
        SapienStage(scenes)


def test_nothing_grows():
    scene = new_scene()
    add_arm(scene)
    with SapienStage(scene) as stage:
        stage.motion_now(stage.now().time_s)
        gc.collect()
        before = len(gc.get_objects())
        for step in range(500):
            scene.step()
            stage.motion_now(stage.now(step).time_s)
        gc.collect()
        assert len(gc.get_objects()) - before < 50


def test_what_is_missing_is_one_line(monkeypatch):
    scene = new_scene()
    with pytest.raises(SceneError, match="scene: expected entities with shapes to draw, got none"):
        SapienStage(scene)
    add_arm(scene)
    with pytest.warns(NoticeWarning, match="no render bodies in the scene: collision shapes are"):
        stage = SapienStage(scene)
    with stage:
        add_arm(scene)
        with pytest.warns(NoticeWarning, match="not drawn: 3 bodies added after the stage"):
            stage.now()
    monkeypatch.setitem(sys.modules, "mani_skill", None)
    monkeypatch.delitem(sys.modules, "omnisim.follow.maniskill_wrapper", raising=False)
    with pytest.raises(OmnisimError, match="ManiSkillWrapper needs ManiSkill: pip install"):
        importlib.import_module("omnisim.follow.maniskill_wrapper")
    monkeypatch.setitem(sys.modules, "sapien", None)
    with pytest.raises(OmnisimError, match="SapienStage needs sapien: pip install"):
        SapienStage(scene)


def test_render_shapes_lights_and_textures_are_sapiens(rendered):
    orange = sapien.render.RenderMaterial(base_color=(0.8, 0.4, 0.2, 1.0))
    checked = sapien.render.RenderMaterial()
    image = np.zeros((2, 2, 4), np.uint8) + 255
    image[0] = (255, 0, 0, 255)
    checked.base_color_texture = sapien.render.RenderTexture2D(image, "R8G8B8A8Unorm")
    builder = rendered.create_actor_builder()
    builder.add_box_visual(sapien.Pose((2.0, 0.0, 1.0)), (0.1, 0.5, 0.5), orange)
    builder.add_plane_visual(scale=(1.0, 5.0, 5.0), material=checked)
    builder.build_static("wall")
    # a mesh of arrays, without normals and texture coordinates
    bare = sapien.render.RenderShapeTriangleMesh(
        KNOT.positions.astype(np.float32), KNOT.triangles.astype(np.uint32),
        np.zeros((0, 3), np.float32), np.zeros((0, 2), np.float32), checked,
    )  # fmt: skip
    body = sapien.render.RenderBodyComponent()
    body.attach(bare)
    entity = sapien.Entity()
    entity.add_component(body)
    entity.name = "bare"
    rendered.add_entity(entity)
    rendered.set_ambient_light((0.5, 0.4, 0.3))
    rendered.add_directional_light((1.0, 0.0, -1.0), (2.0, 1.0, 1.0))
    with SapienStage(rendered) as stage:
        assert stage.notices == ()
        light = stage.scene.lighting.lights[0]
        assert light.kind is LightKind.DIRECTIONAL
        assert light.intensity == pytest.approx(2.0 / np.pi)
        assert light.direction == pytest.approx(np.array((1.0, 0.0, -1.0)) / np.sqrt(2.0))
        assert stage.scene.lighting.ambient == pytest.approx((0.5, 0.4, 0.3))
        assert stage.objects["bare"].meshes[0].normals is None
        assert stage.objects["bare"].materials[0].texture is None
        camera = stage.open(LENS, omnisim.pose((0.0, 0.0, 1.0)), unlit=True)
        frame = camera.render(stage.now())
    expected = np.array((0.8, 0.4, 0.2)) ** (1 / 2.2) * 255
    assert frame.rgb[SIZE // 2, SIZE // 2] == pytest.approx(expected, abs=3)
