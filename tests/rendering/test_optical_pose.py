"""Poses of the camera itself, in place of the vehicle's."""

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import OmnisimError
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from tests.scenes import room, scene_of

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.fixture(scope="module")
def renderer():
    lens = EquidistantCamera(32, 24, 12.0, (15.5, 11.5), theta_max_rad=1.6)
    with open_sensor(scene_of([room()]), OmniCamera(lens)) as renderer:
        yield renderer


def test_an_optical_pose_is_that_of_the_vehicle_whose_camera_is_there(renderer):
    base = pose((0.2, -0.1, 0.4), roll_deg=5.0, pitch_deg=-10.0, yaw_deg=30.0)
    optical = base @ renderer.camera.base_from_optical
    by_base, by_camera = renderer.render(base), renderer.render(optical=optical)
    np.testing.assert_allclose(by_camera.metadata["world_from_optical"], optical, atol=1e-12)
    np.testing.assert_allclose(by_camera.metadata["world_from_base"], base, atol=1e-12)
    off = np.abs(by_base.rgb.astype(int) - by_camera.rgb)
    assert off.max() <= 1  # the poses differ by rounding


@pytest.mark.parametrize(
    ("poses", "got"), [((None, None), "neither"), ((np.eye(4), np.eye(4)), "both")]
)
def test_one_pose_is_expected(renderer, poses, got):
    state, optical = poses
    with pytest.raises(OmnisimError, match=f"expected either state or optical, got {got}"):
        renderer.render(state, optical=optical)


def test_an_invalid_optical_pose_is_refused(renderer):
    with pytest.raises(OmnisimError, match="expected"):
        renderer.render(optical=2.0 * np.eye(4))


def test_a_channel_that_was_not_rendered_names_the_remedy(renderer):
    frame = renderer.render(np.eye(4))
    with pytest.raises(KeyError, match=r"range: not rendered: pass also=\('range',\) to render"):
        frame.channels["range"]
    with pytest.raises(KeyError, match="rangs: there is no such channel; did you mean 'range'"):
        frame.channels["rangs"]
    assert frame.channels.get("range") is None
