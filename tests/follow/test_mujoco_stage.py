"""Cameras in simulations of MuJoCo: bodies move, geoms are told apart, ranges are MuJoCo's."""

import copy
import gc
import tracemalloc

import numpy as np
import pytest

from omnisim import OmniCamera, pose
from omnisim.cameras import EquidistantCamera, PerspectiveCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import OmnisimError, SceneError
from omnisim.follow import BodyStage, MujocoStage
from omnisim.follow.body_stage import NO_BODY
from omnisim.follow.mujoco_stage import NO_GEOM
from tests.follow.pixel_masks import is_inside
from tests.scene.formats.mjcf.models import SHAPES

mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.usefixtures("needs_opengl")
STANDING = pose((0.0, 0.0, 0.8))
FISHEYE = OmniCamera(EquidistantCamera(160, 160, 48.0, (79.5, 79.5), np.radians(95.0)))
ARM = """
<mujoco><worldbody>
  <geom name="floor" type="plane" size="5 5 .1"/><geom name="base" size=".1" pos="0 3 .1"/>
  <body name="base" pos="2 0 .5"><freejoint/><geom name="hull" size=".3"/>
    <body name="arm" pos="0 .3 0"><joint name="elbow" axis="0 0 1"/>
      <geom name="tube" type="capsule" size=".08 .3" pos="0 .3 0" euler="90 0 0"/>
      <body name="hand" pos="0 .7 0"><geom name="palm" type="box" size=".1 .1 .1"/></body>
      <camera name="follow" mode="targetbody" target="base" pos="0 .9 .3"/>
    </body>
  </body>
</worldbody></mujoco>
"""


def _simulation(text):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.fixture
def simulation():
    return _simulation(SHAPES)


def _rays_m(model, data, lens, frame):
    """Ranges of MuJoCo along the rays of a frame's pixels, and the geoms hit."""
    world_from_optical = np.array(frame.metadata["world_from_optical"])
    rays = lens.ray_from_pixel(pixel_grid(lens.width_px, lens.height_px))
    directions = rays.directions.reshape(-1, 3) @ world_from_optical[:3, :3].T
    ranges, geoms = np.empty(len(directions)), np.empty(len(directions), np.int32)
    mujoco.mj_multiRay(
        model, data, world_from_optical[:3, 3].copy(), np.ascontiguousarray(directions).ravel(),
        np.array([1, 1, 1, 0, 0, 0], np.uint8), True, -1, geoms, ranges, None, len(ranges), 1e9,
    )  # fmt: skip
    shape = rays.valid.shape
    return np.where(ranges < 0.0, np.inf, ranges).reshape(shape), geoms.reshape(shape)


def test_frames_follow_the_bodies_of_the_simulation(simulation):
    model, data = simulation
    with MujocoStage(model, data) as stage:
        camera = stage.open(FISHEYE, STANDING)
        seen = []
        for _ in range(3):
            mujoco.mj_step(model, data, 40)  # the ball falls, and rolls
            state = stage.now()
            frame = camera.render(state, also=("range", "instance"))
            assert state.time_s == data.time
            ranges_m, geoms = _rays_m(model, data, FISHEYE.model, frame)
            valid = frame.valid & (ranges_m < 100.0)
            errors_m = np.abs(frame.channels["range"][valid] - ranges_m[valid])
            is_right = errors_m <= np.maximum(1e-3, 1e-3 * ranges_m[valid])
            assert is_right.mean() > 0.997  # at silhouettes of so small an image
            ids, bodies = stage.geom_ids(frame)[valid], stage.body_ids(frame)[valid]
            assert (ids == geoms[valid]).mean() > 0.997
            owners = np.where(ids == NO_GEOM, 0, model.geom_bodyid[ids])
            assert (bodies == np.where(owners > 0, owners, NO_BODY)).all()
            seen.append(frame.rgb)
        assert (seen[0] != seen[2]).any()


@pytest.mark.slow
def test_ranges_and_bodies_are_those_of_mujocos_rays(simulation):
    model, data = simulation
    lens, seen = EquidistantCamera(96, 96, 40.0, (47.5, 47.5), 1.2), []
    with MujocoStage(model, data) as stage:
        camera = stage.open(lens)
        for number in range(10):
            mujoco.mj_step(model, data, 10)
            there = pose((0.0, 0.1, 0.9), yaw_deg=37.0 * number, pitch_deg=20.0)
            frame = camera.render(stage.now().moved({"body": there}), also=("range", "instance"))
            ranges_m, geoms = _rays_m(model, data, lens, frame)
            ids, owners = stage.geom_ids(frame), np.where(geoms < 0, 0, model.geom_bodyid[geoms])
            inside = is_inside(ids) & is_inside(geoms) & frame.valid
            hit = inside & (ranges_m < 100.0)
            errors_m = np.abs(frame.channels["range"][hit] - ranges_m[hit])
            is_right = stage.body_ids(frame) == np.where(owners > 0, owners, NO_BODY)
            seen.append((errors_m < 1e-3, is_right[inside], geoms[hit]))
    is_near, is_right, geoms = (np.concatenate(each) for each in zip(*seen, strict=True))
    assert is_near.mean() > 0.999
    assert is_right.mean() > 0.999
    assert len(np.unique(geoms)) == 9  # all that are visible


def test_geoms_have_their_numbers_and_nothing_has_none(simulation):
    model, data = simulation
    with MujocoStage(model, data) as stage:
        camera = stage.open(FISHEYE, STANDING)
        ids = stage.geom_ids(camera.render(stage.now(), also=("instance",)))
        side = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "side")
        assert stage.geoms["can/side"] == side
        assert NO_GEOM in ids
        assert set(np.unique(ids)) <= {NO_GEOM, *stage.geoms.values()}
        with pytest.raises(OmnisimError, match="geom_ids: expected a frame with also=\\('inst"):
            stage.geom_ids(camera.render(stage.now()))


def test_carriers_are_bodies_sites_and_cameras_of_the_model(simulation):
    model, data = simulation
    data.joint("hinge").qpos = 0.5
    mujoco.mj_forward(model, data)
    forward = pose((0.1, 0.0, 0.0))
    with MujocoStage(model, data) as stage:
        for name, there in (("site/lid", data.site("lid")), ("crate", data.body("crate"))):
            camera = stage.open(FISHEYE, forward, vehicle=name)
            frame = camera.render(stage.now())
            world_from_base = np.array(frame.metadata["world_from_base"])
            assert world_from_base[:3, 3] == pytest.approx(there.xpos)
            assert world_from_base[:3, :3] == pytest.approx(there.xmat.reshape(3, 3))
        for name, message in (
            ("cann", "vehicle = 'cann': did you mean 'can'"),
            ("site/lidd", "site = 'lidd': did you mean 'lid'"),
            ("camera/side", "camera = 'side': the model has top, view"),
        ):
            with pytest.raises(SceneError, match=message):
                stage.open(FISHEYE, vehicle=name)


def test_a_camera_of_the_model_looks_where_mujocos_own_does(simulation):
    model, data = simulation  # straight down, up is +y
    lens = PerspectiveCamera.with_field_of_view(80, 60, np.radians(70.0))
    with MujocoStage(model, data) as stage:
        camera = stage.open(lens, vehicle="camera/top")
        top_left = camera.render(stage.now(), also=("position",)).channels["position"][10, 10]
        assert stage.lens_of("top").width_px == 80
    assert top_left[0] < -1.0
    assert top_left[1] > 1.0


def test_a_camera_that_tracks_a_body_turns_to_it():
    model, data = _simulation(ARM)
    with MujocoStage(model, data) as stage:
        stage.open(FISHEYE, vehicle="camera/follow")
        for angle in (0.0, 1.0):
            data.joint("elbow").qpos = angle
            mujoco.mj_forward(model, data)
            there = stage.now().world_from_object["camera/follow"]
            ahead = data.body("base").xpos - there[:3, 3]
            assert there[:3, 0] == pytest.approx(ahead / np.linalg.norm(ahead))


def test_flow_is_that_of_the_bodies(simulation):
    model, data = simulation
    with MujocoStage(model, data) as stage:
        camera = stage.open(FISHEYE, STANDING)
        before = stage.now()
        mujoco.mj_step(model, data, 50)
        frame = camera.render(before, also=("flow", "instance"), next_state=stage.now())
        moves = np.linalg.norm(frame.channels["flow"], axis=-1) > 0.01
        ids = stage.geom_ids(frame)
    assert moves[ids == stage.geoms["ball/sphere"]].mean() > 0.9
    assert not moves[ids == stage.geoms["can/side"]].any()
    assert before.time_s == 0.0


def test_motion_is_that_of_the_bodies_origins():
    model, data = _simulation(ARM)
    data.qvel[:] = (0.3, -0.2, 0.1, 1.0, 2.0, 3.0, -4.0)
    mujoco.mj_forward(model, data)
    with MujocoStage(model, data) as stage:
        stage.open(FISHEYE, vehicle="camera/follow")
        before, motion, step_s = stage.now(), stage.motion_now(), 1e-4
        for number, name in enumerate(stage.names):
            velocity = np.empty(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, number, velocity, 0)
            moved = motion(data.time + step_s).world_from_object[name]
            there = before.world_from_object[name]
            assert (moved - there)[:3, 3] == pytest.approx(velocity[3:] * step_s, abs=1e-12)
            turn = (moved @ np.linalg.inv(there))[:3, :3]
            rates = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / step_s
            assert rates == pytest.approx(velocity[:3], abs=1e-2)  # second order of the step


def test_many_worlds_have_their_own_poses_and_times():
    model, data = _simulation(ARM)
    worlds = [data, copy.copy(data), copy.copy(data)]
    for number, one in enumerate(worlds):
        one.joint("elbow").qpos = 0.5 * number
        mujoco.mj_step(model, one, number + 1)
        mujoco.mj_forward(model, one)
    with MujocoStage(model, worlds) as stage:
        states = stage.worlds_now()
        for one, state in zip(worlds, states, strict=True):
            assert state.time_s == one.time
            assert state.world_from_object["hand"][:3, 3] == pytest.approx(one.body("hand").xpos)
        camera = stage.open(FISHEYE, vehicle="hand")
        frames = camera.render_batch(states)
        assert (frames[0] != frames[2]).any()
        with pytest.raises(OmnisimError, match="data: expected one world, got 3: see worlds_now"):
            stage.now()


def test_nothing_grows_with_the_steps():
    model, data = _simulation(ARM)
    worlds = [data, copy.copy(data)]
    with MujocoStage(model, data) as one, MujocoStage(model, worlds) as many:

        def step(times):
            for _ in range(times):
                one.now(), one.motion_now()(0.1), many.worlds_now()
            gc.collect()
            return tracemalloc.get_traced_memory()[0]

        tracemalloc.start()
        try:
            first, last = step(20), step(200)
        finally:
            tracemalloc.stop()
    assert last - first < 200 * 16  # not even two pointers for each step


@pytest.mark.slow
def test_worlds_of_mujoco_warp_are_those_of_mujoco():
    warp = pytest.importorskip("mujoco_warp", reason="MuJoCo Warp is not installed")
    model, data = _simulation(ARM)
    worlds = warp.put_data(model, data, nworld=3)
    angles = worlds.qpos.numpy()
    angles[:, -1] = (0.0, 0.5, 1.0)
    worlds.qpos.assign(angles)
    warp.kinematics(warp.put_model(model), worlds)
    with MujocoStage(model, worlds) as stage:
        states = stage.worlds_now()
    for angle, state in zip(angles[:, -1], states, strict=True):
        data.joint("elbow").qpos = angle
        mujoco.mj_forward(model, data)
        for name in stage.names:
            there = state.world_from_object[name]
            assert there[:3, 3] == pytest.approx(data.body(name).xpos, abs=1e-6)
            assert there[:3, :3] == pytest.approx(data.body(name).xmat.reshape(3, 3), abs=1e-6)


def test_bodies_of_a_file_follow_poses_without_a_simulation(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    model, data = _simulation(ARM)
    names = [model.body(number).name for number in range(model.nbody)]
    with BodyStage(path, names=names) as stage, MujocoStage(model, data) as live:
        # the geom of the world that is named as a body stands still
        assert {name: body.instance_names for name, body in stage.objects.items()} == {
            "base": ("base/hull",),
            "arm": ("arm/tube", "hand/palm"),
        }
        assert stage.scene.instance_names == live.scene.instance_names == ("floor", "base")
        data.joint("elbow").qpos = 1.0
        mujoco.mj_forward(model, data)
        images = [
            one.open(FISHEYE, STANDING, unlit=True).render(state).rgb
            for one, state in ((stage, stage.state(data.xpos, data.xquat)), (live, live.now()))
        ]
    assert (images[0] == images[1]).all()


def test_mocap_bodies_move_and_hidden_geoms_are_not_drawn():
    model, data = _simulation(
        "<mujoco><worldbody><geom type='plane' size='5 5 .1'/>"
        "<body name='hand' mocap='true' pos='2 0 1'><geom name='palm' size='.3'/>"
        "<body><geom name='thumb' size='.1' pos='0 .5 0'/></body></body></worldbody></mujoco>"
    )
    with MujocoStage(model, data) as stage:
        camera = stage.open(FISHEYE, pose((0.0, 0.0, 1.0)))
        first = stage.geom_ids(camera.render(stage.now(), also=("instance",)))
        data.mocap_pos[0] = (1.0, 0.5, 1.0)
        mujoco.mj_kinematics(model, data)
        second = stage.geom_ids(camera.render(stage.now(), also=("instance",)))
        assert (second == 1).sum() > 2 * (first == 1).sum() > 0
        assert (second == 2).any()
    with MujocoStage(model, data, hidden=["hand/palm"]) as stage:
        assert "hand/palm" not in stage.objects["hand"].instance_names
    with pytest.raises(SceneError, match="hidden: 'palm': did you mean"):
        MujocoStage(model, data, hidden=["palm"])
    for wrong in (model, []):
        with pytest.raises(OmnisimError, match="expected an MjModel and its MjData, got MjModel"):
            MujocoStage(model, wrong)


def test_lenses_of_the_model_have_their_sizes():
    model, data = _simulation(
        "<mujoco><worldbody><geom size='1'/><camera name='a' fovy='90'/>"
        "<camera name='b' resolution='80 60'/><camera name='c' projection='orthographic'/>"
        "</worldbody></mujoco>"
    )
    with MujocoStage(model, data) as stage:
        wide = stage.lens_of("a")
        assert (wide.width_px, wide.height_px) == (640, 480)
        assert wide.focal_length_px == pytest.approx(240.0)
        assert stage.lens_of("a", (100, 50)).focal_length_px == pytest.approx(25.0)
        assert (stage.lens_of("b").width_px, stage.lens_of("b").height_px) == (80, 60)
        with pytest.raises(SceneError, match="expected a perspective camera, got an orthographic"):
            stage.lens_of("c")


def test_skins_and_cloths_are_bent_in_each_frame():
    cloth = (
        "<body name='cloth' pos='2 0 1'><flexcomp name='cloth' type='grid' count='4 4 1'"
        " spacing='.3 .3 .1' dim='2' euler='0 90 0' radius='.01'><edge equality='true'/>"
        "</flexcomp></body>"
    )
    model, data = _simulation(
        f"<mujoco><worldbody><geom type='plane' size='9 9 .1'/>{cloth}</worldbody></mujoco>"
    )
    with MujocoStage(model, data) as stage:
        camera = stage.open(FISHEYE, pose((0.0, 0.0, 1.0)))
        rows = []
        for _ in range(3):
            frame = camera.render(stage.now(), also=("instance",))
            (cloth_id,) = (
                instance.id for instance in frame.labels.instances if instance.name == "cloth"
            )
            is_cloth = frame.channels["instance"] == cloth_id
            assert (stage.geom_ids(frame)[is_cloth] == NO_GEOM).all()
            rows.append(is_cloth.nonzero()[0].mean())
            mujoco.mj_step(model, data, 60)
    assert rows[0] + 1.0 < rows[1]  # it falls
    assert rows[1] + 1.0 < rows[2]
