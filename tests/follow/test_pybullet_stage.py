"""PyBullet: what its rays hit, how its links move, and what it does not tell."""

import gc
import importlib
import re
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import NoticeWarning, OmnisimError, SceneError
from omnisim.follow import PyBulletStage, Shape, shape_scene
from omnisim.follow.body_shapes import height_field

bullet = pytest.importorskip("pybullet")
pytestmark = pytest.mark.usefixtures("needs_opengl")
DATA = Path(importlib.import_module("pybullet_data").getDataPath())
SIZE = 96
LENS = EquidistantCamera(SIZE, SIZE, 29.0, ((SIZE - 1) / 2, (SIZE - 1) / 2), 1.6)


@pytest.fixture
def client():
    number = bullet.connect(bullet.DIRECT)
    bullet.setAdditionalSearchPath(str(DATA), physicsClientId=number)
    yield number
    bullet.disconnect(number)


def with_visual_collisions(urdf, folder):
    """Copy of a robot that collides, and is hit by rays, as it looks: by all its triangles."""
    robot = ElementTree.parse(urdf)
    for link in robot.iter("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
        for visual in link.findall("visual"):
            collision = ElementTree.SubElement(link, "collision", concave="yes")
            collision.extend(visual.findall("origin") + visual.findall("geometry"))
    for mesh in robot.iter("mesh"):
        mesh.set("filename", str(urdf.parent / mesh.get("filename")))
    copy = folder / urdf.name
    robot.write(copy)
    return str(copy)


def rays_of(frame):
    """Origin (3,) and directions (height, width, 3) of a frame's pixels in the world."""
    world_from_optical = np.array(frame.metadata["world_from_optical"])
    rays = LENS.ray_from_pixel(pixel_grid(SIZE, SIZE))
    return world_from_optical[:3, 3], rays.directions @ world_from_optical[:3, :3].T


def hits_of(client, frame, reach_m=60.0):
    """Ranges (height, width) of PyBullet's rays, and the body and link that each one hits."""
    origin, directions = rays_of(frame)
    ends = (origin + reach_m * directions).reshape(-1, 3)
    starts = np.broadcast_to(origin, ends.shape)
    hits = bullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=client)
    ranges = np.array([hit[2] * reach_m if hit[0] >= 0 else np.inf for hit in hits])
    return ranges.reshape(SIZE, SIZE), [hit[:2] for hit in hits]


def inner(ids):
    """Pixels whose four neighbors show the same body."""
    same = np.zeros(ids.shape, dtype=bool)
    middle = ids[1:-1, 1:-1]
    neighbors = ids[:-2, 1:-1], ids[2:, 1:-1], ids[1:-1, :-2], ids[1:-1, 2:]
    same[1:-1, 1:-1] = np.all([middle == other for other in neighbors], axis=0)
    return same


def compare(client, stage, bodies, rng, poses):
    """Errors of ranges (m) away from edges, and whether the bodies seen there are the same."""
    camera, errors, is_same = stage.open(LENS), [], []
    for _ in range(poses):
        for body in bodies:
            for joint in range(bullet.getNumJoints(body, physicsClientId=client)):
                bullet.resetJointState(body, joint, rng.uniform(-0.5, 0.5), physicsClientId=client)
            place = (*rng.uniform(-1.5, 1.5, 2), rng.uniform(0.5, 1.2))
            turn = rng.normal(size=4)
            bullet.resetBasePositionAndOrientation(
                body, place, turn / np.linalg.norm(turn), physicsClientId=client
            )
        at = (*rng.uniform(-0.5, 0.5, 2), rng.uniform(0.3, 1.5))
        yaw_deg, pitch_deg = rng.uniform(0.0, 360.0), rng.uniform(-20.0, 40.0)
        eye = omnisim.pose(at, yaw_deg=yaw_deg, pitch_deg=pitch_deg)
        frame = camera.render(stage.now().moved({camera.vehicle: eye}), also=("range", "instance"))
        ranges_m, hits = hits_of(client, frame)
        hit_ids = [stage.links.index(hit) if hit[0] >= 0 else -1 for hit in hits]
        hit_ids = np.reshape(hit_ids, ranges_m.shape)
        ids = stage.body_ids(frame)
        chosen = frame.valid & inner(ids) & inner(hit_ids)
        is_same.append((ids == hit_ids)[chosen])
        chosen &= np.isfinite(ranges_m) & np.isfinite(frame.channels["range"])
        errors.append(np.abs(frame.channels["range"][chosen] - ranges_m[chosen]))
    return np.concatenate(errors), np.concatenate(is_same)


@pytest.mark.slow
def test_meshes_are_where_pybullets_rays_hit_them(client, tmp_path):
    bullet.loadURDF("plane.urdf", physicsClientId=client)
    robots = ("laikago/laikago_toes.urdf", "kuka_iiwa/model.urdf", "a1/a1.urdf", "duck_vhacd.urdf")
    paths = [with_visual_collisions(DATA / robot, tmp_path) for robot in robots]
    bodies = [bullet.loadURDF(path, physicsClientId=client) for path in paths]
    with PyBulletStage(client) as stage:
        assert stage.notices == ()
        errors_m, is_same = compare(client, stage, bodies, np.random.default_rng(1), 10)
    assert (errors_m < 1e-3).mean() > 0.999
    assert is_same.mean() > 0.999


@pytest.mark.slow
def test_exact_shapes_are_where_pybullets_rays_hit_them(client):
    """Bullet's rays at convex shapes are inexact: at a box, 1.5 % are off by 1 to 17 mm."""
    at = {"physicsClientId": client}
    sizes = {"radius": 0.2, "halfExtents": (0.1, 0.2, 0.3)}
    turn = np.array((0.5, -0.1, 0.7, 0.5))
    frame = (0.1, 0.2, -0.3), turn / np.linalg.norm(turn)
    bodies = []
    for kind in (bullet.GEOM_SPHERE, bullet.GEOM_BOX, bullet.GEOM_CYLINDER, bullet.GEOM_CAPSULE):
        shape = bullet.createCollisionShape(kind, **sizes, height=0.5, **at)
        look = bullet.createVisualShape(kind, **sizes, length=0.5, **at)
        bodies.append(
            bullet.createMultiBody(
                1.0, shape, look, baseInertialFramePosition=frame[0],
                baseInertialFrameOrientation=frame[1], **at,
            )
        )  # fmt: skip
    bodies.append(bullet.loadURDF(str(DATA / "r2d2.urdf"), **at))
    bullet.loadURDF("plane_implicit.urdf", **at)
    with PyBulletStage(client) as stage:
        errors_m, is_same = compare(client, stage, bodies[:4], np.random.default_rng(2), 10)
    assert (errors_m < 5e-3).mean() > 0.97
    assert np.median(errors_m) < 1e-4
    assert is_same.mean() > 0.995


@pytest.mark.slow
def test_velocities_are_those_of_the_links_origins(client):
    at = {"physicsClientId": client}
    robot = bullet.loadURDF("laikago/laikago_toes.urdf", (0.0, 0.0, 2.0), **at)
    bullet.resetBaseVelocity(robot, (1.0, 0.5, 0.0), (0.5, 2.0, -1.0), **at)
    for joint in range(bullet.getNumJoints(robot, **at)):
        bullet.resetJointState(robot, joint, 0.1 * joint, 1.0, **at)
    step_s = 1e-4
    bullet.setTimeStep(step_s, **at)
    with PyBulletStage(client) as stage:
        bullet.stepSimulation(**at)
        before = stage.now(0.2)
        bullet.stepSimulation(**at)
        motion = stage.motion_now(0.2 + step_s)
        back = motion(0.2)
    assert back.time_s == before.time_s == 0.2
    for name, pose in before.world_from_object.items():
        # a meter per second is 0.1 mm; the joints' accelerations, far less
        np.testing.assert_allclose(back.world_from_object[name], pose, atol=5e-6, err_msg=name)


def test_a_state_is_after_the_last_step(client):
    at = {"physicsClientId": client}
    robot = bullet.loadURDF("kuka_iiwa/model.urdf", useFixedBase=True, **at)
    with PyBulletStage(client) as stage:
        for joint in range(7):
            bullet.setJointMotorControl2(
                robot, joint, bullet.VELOCITY_CONTROL, targetVelocity=2.0, force=1e3, **at
            )
        for _ in range(20):
            bullet.stepSimulation(**at)
        hand = stage.now().world_from_object[stage.name_of(robot, 6)]
    expected = bullet.getLinkState(robot, 6, computeForwardKinematics=True, **at)[4]
    np.testing.assert_allclose(hand[:3, 3], expected, atol=1e-12)


def test_links_have_the_names_of_their_bodies(client):
    at = {"physicsClientId": client}
    ball = bullet.createVisualShape(bullet.GEOM_SPHERE, radius=0.1, **at)
    for _ in range(2):
        bullet.loadURDF("r2d2.urdf", **at)
    lone = bullet.createMultiBody(0.0, -1, ball, **at)
    with PyBulletStage(client) as stage:
        assert stage.names[0] == stage.name_of(0) == "physics/base_link"
        assert stage.name_of(1, 1) == "physics_2/right_base"
        assert stage.name_of(lone) == f"body{lone}/link0"
        assert stage.links[:3] == ((0, -1), (0, 0), (0, 1))
        with pytest.raises(SceneError, match="body 7, link -1: unknown when the stage was opened"):
            stage.name_of(7)


def test_what_pybullet_does_not_tell_is_drawn_from_files(client):
    at = {"physicsClientId": client}
    heights = np.tile(np.linspace(0.0, 1.0, 16), (16, 1))
    field = bullet.createCollisionShape(
        bullet.GEOM_HEIGHTFIELD, meshScale=(0.1, 0.1, 1.0), numHeightfieldRows=16,
        numHeightfieldColumns=16, heightfieldData=heights.ravel().tolist(), **at,
    )  # fmt: skip
    ball = bullet.createVisualShape(bullet.GEOM_SPHERE, radius=0.1, **at)
    bullet.createMultiBody(0.0, -1, ball, (3.0, 3.0, 3.0), **at)
    ground = bullet.createMultiBody(0.0, field, -1, **at)
    path = DATA / "kuka_iiwa" / "model.urdf"
    arm = bullet.loadURDF(str(path), (5.0, 0.0, 0.0), **at)
    with pytest.warns(NoticeWarning, match=re.escape(f"files={{{ground}: …}}")):
        PyBulletStage(client).close()
    shape = shape_scene("", [Shape(height_field(heights - 0.5, 0.75, 0.75))])
    with PyBulletStage(client, files={ground: shape, arm: path}) as stage:
        assert stage.name_of(arm, 6) in stage.objects
        camera = stage.open(LENS, omnisim.pose((0.0, 0.0, 3.0), pitch_deg=90.0))
        frame = camera.render(stage.now(), also=("range", "instance"))
        seen = stage.body_ids(frame) == stage.names.index(stage.name_of(ground))
    ranges_m, _ = hits_of(client, frame)
    assert seen.sum() > 100
    seen &= inner(seen)
    assert (np.abs(frame.channels["range"][seen] - ranges_m[seen]) < 1e-3).mean() > 0.99
    with pytest.raises(SceneError, match=r"files: expected IDs of \[0, 1, 2\], got 7"):
        PyBulletStage(client, files={7: shape})


def test_capsules_of_mjcf_are_not_drawn_where_they_are_not(client):
    (ant,) = bullet.loadMJCF(str(DATA / "mjcf" / "ant.xml"), physicsClientId=client)
    with pytest.warns(NoticeWarning, match=r"capsules of MJCF.*\(12 shapes\)"):
        stage = PyBulletStage(client)
    assert list(stage.objects) == [stage.name_of(ant)]  # the torso, a ball
    stage.close()


def test_colors_and_textures_are_pybullets(client):
    at = {"physicsClientId": client}
    bullet.loadURDF("plane.urdf", **at)
    orange = bullet.createVisualShape(
        bullet.GEOM_BOX, halfExtents=(0.1, 1.0, 1.0), rgbaColor=(0.8, 0.4, 0.2, 1.0), **at
    )
    hidden = bullet.createVisualShape(
        bullet.GEOM_BOX, halfExtents=(0.1, 1.0, 1.0), rgbaColor=(0.0, 0.0, 0.0, 0.0), **at
    )
    bullet.createMultiBody(0.0, -1, orange, (2.0, 0.0, 1.0), **at)
    bullet.createMultiBody(0.0, -1, hidden, (1.0, 0.0, 1.0), **at)
    with PyBulletStage(client) as stage:
        pose = omnisim.pose((0.0, 0.0, 1.0))
        frame = stage.open(LENS, pose, unlit=True).render(stage.now())
    assert frame.rgb[SIZE // 2, SIZE // 2].tolist() == [204, 102, 51]
    floor = frame.rgb[-20:-10, 30:66].reshape(-1, 3)
    assert {tuple(color) for color in floor.tolist()} > {(255, 255, 255)}  # and blue


def test_planes_are_perpendicular_to_their_normals(client):
    at = {"physicsClientId": client}
    wall = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=(-1.0, 0.0, 0.0), **at)
    bullet.createMultiBody(0.0, wall, -1, (2.0, 0.0, 0.0), **at)
    with PyBulletStage(client) as stage:
        camera = stage.open(LENS, omnisim.pose((0.0, 0.0, 1.0)))
        frame = camera.render(stage.now(), also=("range",))
    assert frame.channels["range"][SIZE // 2, SIZE // 2] == pytest.approx(2.0, abs=2e-3)


def test_bodies_that_come_and_go_are_one_line(client):
    at = {"physicsClientId": client}
    ball = bullet.createVisualShape(bullet.GEOM_SPHERE, radius=0.1, **at)
    bullet.createMultiBody(0.0, -1, ball, **at)
    with PyBulletStage(client) as stage:
        added = bullet.createMultiBody(0.0, -1, ball, **at)
        with pytest.warns(NoticeWarning, match="not drawn: 1 body added after the stage"):
            stage.now()
        with warnings.catch_warnings(action="error"):
            stage.now()
        bullet.removeBody(added, **at)
        stage.now()
        bullet.removeBody(0, **at)
        with pytest.raises(OmnisimError, match="body 0 was removed: open another stage"):
            stage.now()


def test_a_simulation_may_start_anew_and_nothing_grows(client):
    at = {"physicsClientId": client}

    def load(height_m):
        bullet.loadURDF(str(DATA / "r2d2.urdf"), (0.0, 0.0, height_m), **at)

    load(1.0)
    with PyBulletStage(client) as stage:
        first = stage.now().world_from_object["physics/head"]
        bullet.resetSimulation(**at)
        load(1.5)
        second = stage.now().world_from_object["physics/head"]
        np.testing.assert_allclose(second - first, omnisim.pose((0, 0, 0.5)) - np.eye(4), atol=1e-9)
        gc.collect()
        before = len(gc.get_objects())
        for step in range(500):
            bullet.stepSimulation(**at)
            stage.motion_now(stage.now(step).time_s)
        gc.collect()
        assert len(gc.get_objects()) - before < 50


def test_bad_clients_are_one_line(client, monkeypatch):
    with pytest.raises(OmnisimError, match="client 99: expected a connected client"):
        PyBulletStage(99)
    with pytest.raises(SceneError, match=f"client {client}: expected bodies to draw, got none"):
        PyBulletStage(client)
    monkeypatch.setitem(importlib.sys.modules, "pybullet", None)
    with pytest.raises(OmnisimError, match="PyBulletStage needs pybullet: pip install"):
        PyBulletStage(client)


def test_clients_are_worlds_of_a_batch(client):
    other = bullet.connect(bullet.DIRECT)
    try:
        for number, height in ((client, 0.0), (other, 0.5)):
            bullet.loadURDF(str(DATA / "plane.urdf"), (0, 0, height), physicsClientId=number)
        with PyBulletStage([client, other]) as stage:
            states = stage.worlds_now(0.5)
            camera = stage.open(LENS, omnisim.pose((0.0, 0.0, 1.0), pitch_deg=90.0))
            ranges_m = camera.render_batch(states, channels=("range",))["range"]
            np.testing.assert_allclose(ranges_m[:, SIZE // 2, SIZE // 2], (1.0, 0.5), atol=1e-3)
    finally:
        bullet.disconnect(other)
