"""Unwarped channels: values of the image and no others, in the view's own frame."""

import numpy as np
import pytest

from omnisim import OmniCamera, open_sensor
from omnisim.cameras import EquidistantCamera, EquirectangularCamera, PerspectiveCamera
from omnisim.core.errors import OpticsError, OutputError
from omnisim.core.poses import pose
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.channels import FLOWS
from omnisim.perception.unwarping import ChannelUnwarping
from tests.scenes import room, scene_of
from tests.vehicles import box

pytestmark = pytest.mark.usefixtures("needs_opengl")

NOW = pose((0.3, -0.4, 0.1), roll_deg=12.0, pitch_deg=-20.0, yaw_deg=33.0)
AFTER = NOW @ pose((0.05, 0.02, 0.0), yaw_deg=2.0)
FISHEYE = EquidistantCamera(300, 300, 95.0, (149.5, 149.5))
TURN = pose(roll_deg=10.0, pitch_deg=25.0, yaw_deg=-15.0)[:3, :3]  # camera_from_view
VIEWS = {
    "perspective": PerspectiveCamera(120, 90, 90.0, (59.5, 44.5)),
    "equirectangular": EquirectangularCamera(160, 80),
}
views = pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS.keys())


@pytest.fixture(scope="module")
def scene():
    return scene_of([room(), box("crate", 0, half_m=0.4)], poses=[pose(), pose((1.2, 0.3, 0.2))])


def _render(scene, camera, now=NOW, after=AFTER):
    sensor = OmniCamera(camera, polygons=None, supersampling=1)
    with open_sensor(scene, sensor) as renderer:
        return renderer.render(now, also=tuple(CHANNELS), next_state=after, previous_state=after)


@pytest.fixture(scope="module")
def image(scene):
    return _render(scene, FISHEYE)


def _world_from_view(image):
    world_from_view = np.array(image.metadata["world_from_optical"])
    world_from_view[:3, :3] = world_from_view[:3, :3] @ TURN
    return world_from_view


def test_view_of_the_image_itself_has_its_channels(image):
    unwarp = ChannelUnwarping(FISHEYE, FISHEYE, np.eye(3))
    found = unwarp(image.channels, image.metadata["world_from_optical"])
    np.testing.assert_array_equal(unwarp.valid, image.channels["valid"] > 0)
    assert list(found) == list(CHANNELS)
    for name, values in found.items():
        expected = image.channels[name]
        assert values.dtype == expected.dtype
        made = name == "z" or name in ("flow", "flow_backward")
        bound = {"z": 1e-5}.get(name, 1e-3) if made else 0.0
        np.testing.assert_allclose(values, expected, rtol=0.0, atol=bound, err_msg=name)


@views
def test_no_value_is_invented(image, view):
    found = ChannelUnwarping(FISHEYE, view, TURN)(image.channels, _world_from_view(image))
    for name in ("range", "instance", "semantic", "occluded", "valid"):
        there = np.append(np.unique(image.channels[name]), (CHANNELS[name].empty, 2))
        assert np.isin(found[name], there).all(), name
    triples = {row.tobytes() for row in image.channels["position"].reshape(-1, 3)}
    known = np.isfinite(found["position"]).all(axis=-1)
    assert {row.tobytes() for row in found["position"][known]} <= triples
    outside = found["valid"] == 0
    for name, values in found.items():
        np.testing.assert_array_equal(values[outside], CHANNELS[name].empty)


@views
def test_channels_are_those_of_the_view_itself(image, scene, view):
    """Rendered from the same viewpoint, where a ray is up to 0.7 px of the image off."""
    unwarp = ChannelUnwarping(FISHEYE, view, TURN)
    found = unwarp(image.channels, _world_from_view(image))
    into_base = FISHEYE.rig_from_optical @ TURN @ view.rig_from_optical.T
    turned = np.eye(4)
    turned[:3, :3] = into_base
    own = _render(scene, view, NOW @ turned, AFTER @ turned).channels
    same = unwarp.valid & (found["instance"] == own["instance"])
    assert same.sum() > 0.97 * unwarp.valid.sum()
    same &= np.abs(found["normals"] - own["normals"]).max(axis=-1) < 1e-3
    assert same.sum() > 0.95 * unwarp.valid.sum()
    # relative to the camera they are turned, exactly: the walls are flat
    off = np.abs(found["normals_camera"] - own["normals_camera"])[same]
    assert off.max() < 1e-5
    for name in CHANNELS:
        # poles of a sphere turn a small angle into many pixels
        share, bound = (90, 0.1) if name in FLOWS else (95, 0.03)
        off = np.abs(found[name].astype(np.float64) - own[name])[same]
        if name not in FLOWS.values():  # outside of the image is not outside of the view
            assert np.nanpercentile(off, share) < bound, name


@views
def test_flow_leads_to_where_the_point_will_be_seen(image, view):
    """By the exact points, of the image's own ray."""
    found = ChannelUnwarping(FISHEYE, view, TURN)(image.channels, _world_from_view(image))
    now = _world_from_view(image)
    after = AFTER @ np.linalg.inv(NOW) @ now
    known = np.isfinite(found["flow"]).all(axis=-1)
    points = found["position"][known]
    seen = [
        view.pixel_from_ray((points - one[:3, 3]) @ one[:3, :3]).positions_px
        for one in (now, after)
    ]
    expected = seen[1] - seen[0]
    if isinstance(view, EquirectangularCamera):
        expected[:, 0] -= view.width_px * np.round(expected[:, 0] / view.width_px)
    assert known.sum() > 3000
    off = np.linalg.norm(found["flow"][known] - expected, axis=-1)
    assert np.percentile(off, 99) < 1e-3
    u, v = np.moveaxis(seen[1], -1, 0)
    left = (u < -0.5) | (u >= view.width_px - 0.5) | (v < -0.5) | (v >= view.height_px - 0.5)
    assert (found["occluded"][known][left] == 2).all()


def test_what_cannot_be_made_is_refused_by_name(image):
    unwarp = ChannelUnwarping(FISHEYE, VIEWS["perspective"], TURN)
    with pytest.raises(OutputError, match="'z': requires the channel position"):
        unwarp({"z": image.channels["z"]}, np.eye(4))
    with pytest.raises(OutputError, match=r"'range': expected 300 × 300 px, .* got 9 × 7"):
        unwarp({"range": np.zeros((7, 9))})
    behind = np.diag((1.0, -1.0, -1.0))
    narrow = PerspectiveCamera(20, 20, 200.0, (9.5, 9.5))
    with pytest.raises(OpticsError, match="shows nothing of this view"):
        ChannelUnwarping(narrow, narrow, behind)
