"""Cameras in simulations of MuJoCo: bodies move, geoms are told apart, ranges are MuJoCo's."""

import numpy as np
import pytest

from omnisim import OmniCamera, pose
from omnisim.cameras import EquidistantCamera, PerspectiveCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import OmnisimError, SceneError
from omnisim.runs.mujoco_camera import NO_GEOM, Camera
from omnisim.scene.formats.mjcf.reader import lens_of
from tests.scene.formats.mjcf.models import SHAPES

mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.usefixtures("needs_opengl")
STANDING = pose((0.0, 0.0, 0.8))
LENS = EquidistantCamera(160, 160, 48.0, (79.5, 79.5), np.radians(95.0))
FISHEYE = OmniCamera(LENS, supersampling=1)


@pytest.fixture
def simulation():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _rays_m(model, data, camera, frame):
    """Ranges of MuJoCo along the rays of a frame's pixels, and the geoms hit."""
    world_from_optical = np.array(frame.metadata["world_from_optical"])
    lens = camera.sensor.model
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
    with Camera(model, data, FISHEYE, pose=STANDING) as camera:
        seen = []
        for _ in range(3):
            mujoco.mj_step(model, data, 40)  # the ball falls, and rolls
            frame = camera.render(also=("range", "instance"))
            ranges_m, geoms = _rays_m(model, data, camera, frame)
            valid = frame.valid & (ranges_m < 100.0)
            errors_m = np.abs(frame.channels["range"][valid] - ranges_m[valid])
            is_right = errors_m <= np.maximum(1e-3, 1e-3 * ranges_m[valid])
            assert is_right.mean() > 0.997  # at silhouettes of so small an image
            assert (camera.geom_ids(frame)[valid] == geoms[valid]).mean() > 0.997
            assert frame.metadata["world_from_base"] == STANDING.tolist()
            seen.append(frame.rgb)
        assert (seen[0] != seen[2]).any()


def test_geoms_have_their_numbers_and_nothing_has_none(simulation):
    model, data = simulation
    with Camera(model, data, FISHEYE, pose=STANDING) as camera:
        ids = camera.geom_ids(camera.render(also=("instance",)))
        side = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "side")
        assert camera.geoms["can/side"] == side
        assert NO_GEOM in ids
        assert set(np.unique(ids)) <= {NO_GEOM, *camera.geoms.values()}
        with pytest.raises(OmnisimError, match="expected a frame with also=\\('instance',\\)"):
            camera.geom_ids(camera.render())


def test_mounts_are_bodies_sites_and_cameras_of_the_model(simulation):
    model, data = simulation
    data.joint("hinge").qpos = 0.5
    mujoco.mj_forward(model, data)
    forward = pose((0.1, 0.0, 0.0))
    with Camera(model, data, FISHEYE, site="lid", pose=forward) as camera:
        expected = np.eye(4)
        expected[:3, :3] = data.site("lid").xmat.reshape(3, 3)
        expected[:3, 3] = data.site("lid").xpos
        assert camera.world_from_base == pytest.approx(expected @ forward)
    with Camera(model, data, FISHEYE, body="crate") as camera:
        assert camera.world_from_base[:3, 3] == pytest.approx(data.body("crate").xpos)
        before = camera.world_from_base
        data.joint("hinge").qpos = 1.0
        mujoco.mj_forward(model, data)
        assert (camera.world_from_base != before).any()
    for mount, message in (
        ({"body": "can", "site": "lid"}, "expected one mount, got body and site"),
        ({"body": "cann"}, "body = 'cann': did you mean 'can'"),
    ):
        with pytest.raises(SceneError, match=message):
            Camera(model, data, FISHEYE, **mount)


def test_a_camera_of_the_model_looks_where_mujocos_own_does(simulation):
    model, data = simulation  # straight down, up is +y
    lens = PerspectiveCamera.with_field_of_view(80, 60, np.radians(70.0))
    with Camera(model, data, lens, camera="top") as camera:
        frame = camera.render(also=("position",))
        there = frame.channels["position"]
    top_left = there[10, 10]
    assert top_left[0] < -1.0
    assert top_left[1] > 1.0


def test_flow_is_that_of_the_bodies(simulation):
    model, data = simulation
    with Camera(model, data, FISHEYE, pose=STANDING) as camera:
        before = camera.state()
        mujoco.mj_step(model, data, 50)
        frame = camera.render(before, also=("flow", "instance"), next_state=camera.state())
        moves = np.linalg.norm(frame.channels["flow"], axis=-1) > 0.01
        ids = camera.geom_ids(frame)
    assert moves[ids == camera.geoms["ball/sphere"]].mean() > 0.9
    assert not moves[ids == camera.geoms["can/side"]].any()
    assert frame.metadata["world_from_base"] == STANDING.tolist()


def test_mocap_bodies_move_and_hidden_geoms_are_not_drawn():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom type='plane' size='5 5 .1'/>"
        "<body name='hand' mocap='true' pos='2 0 1'><geom name='palm' size='.3'/>"
        "<body><geom name='thumb' size='.1' pos='0 .5 0'/></body></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with Camera(model, data, FISHEYE, pose=pose((0.0, 0.0, 1.0))) as camera:
        first = camera.geom_ids(camera.render(also=("instance",)))
        data.mocap_pos[0] = (1.0, 0.5, 1.0)
        mujoco.mj_kinematics(model, data)
        second = camera.geom_ids(camera.render(also=("instance",)))
        assert (second == 1).sum() > 2 * (first == 1).sum() > 0
        assert (second == 2).any()
    with Camera(model, data, FISHEYE, pose=pose((0.0, 0.0, 1.0)), hidden=["hand/palm"]) as camera:
        ids = camera.geom_ids(camera.render(also=("instance",)))
        assert not (ids == 1).any()
    with pytest.raises(SceneError, match="hidden: 'palm': did you mean"):
        Camera(model, data, FISHEYE, hidden=["palm"])


def test_lenses_of_the_model_have_their_sizes():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><camera name='a' fovy='90'/><camera name='b' resolution='80 60'/>"
        "<camera name='c' projection='orthographic'/></worldbody></mujoco>"
    )
    wide = lens_of(model, "a")
    assert (wide.width_px, wide.height_px) == (640, 480)
    assert wide.focal_length_px == pytest.approx(240.0)
    assert lens_of(model, "a", (100, 50)).focal_length_px == pytest.approx(25.0)
    assert (lens_of(model, "b").width_px, lens_of(model, "b").height_px) == (80, 60)
    with pytest.raises(SceneError, match="expected a perspective camera, got an orthographic"):
        lens_of(model, "c")


def test_skins_and_cloths_are_bent_in_each_frame():
    cloth = (
        "<flexcomp name='cloth' type='grid' count='4 4 1' spacing='.3 .3 .1' pos='2 0 1' dim='2'"
        " euler='0 90 0' radius='.01'><edge equality='true'/></flexcomp>"
    )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><geom type='plane' size='9 9 .1'/>{cloth}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with Camera(model, data, FISHEYE, pose=pose((0.0, 0.0, 1.0))) as camera:
        rows = []
        for _ in range(3):
            frame = camera.render(also=("instance",))
            (cloth_id,) = (
                instance.id for instance in frame.labels.instances if instance.name == "cloth"
            )
            is_cloth = frame.channels["instance"] == cloth_id
            assert (camera.geom_ids(frame)[is_cloth] == NO_GEOM).all()
            rows.append(is_cloth.nonzero()[0].mean())
            mujoco.mj_step(model, data, 60)
    assert rows[0] + 1.0 < rows[1]  # it falls
    assert rows[1] + 1.0 < rows[2]
