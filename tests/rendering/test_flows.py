"""Forward, backward and scene flow: consistent with each other, and with rigid motions."""

import numpy as np
import pytest

from omnisim import OmniCamera, Stage
from omnisim.cameras import EquirectangularCamera, HyperbolicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.bilinear import corner_and_weights
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.truth import VISIBLE
from tests.scenes import room, scene_of
from tests.vehicles import box

pytestmark = pytest.mark.usefixtures("needs_opengl")

NOW = pose((-1.0, 0.1, 0.05), roll_deg=4.0, yaw_deg=10.0)
AFTER = NOW @ pose((0.06, 0.02, 0.01), yaw_deg=2.0, pitch_deg=1.0)
CRATE_NOW, CRATE_AFTER = pose((0.3, 0.2, 0.1)), pose((0.34, 0.12, 0.15), yaw_deg=6.0)
LENSES = {
    "mirror": HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 240, 240),
    "sphere": EquirectangularCamera(240, 120),
}
lenses = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
FLOWS = ("flow", "flow_backward", "scene_flow", "scene_flow_camera")


@pytest.fixture(scope="module")
def stage():
    crate = scene_of([box("crate", 0, half_m=0.25)])
    with Stage(scene_of([room()]), dynamic_objects={"crate": crate}) as stage:
        yield stage


def _frame(stage, lens, now, other, also):
    """Frame at one of the two times, with the other as its next and its previous one."""
    crates = {NOW.tobytes(): CRATE_NOW, AFTER.tobytes(): CRATE_AFTER}
    sensor = OmniCamera(lens, polygons=None, supersampling=1)
    with stage.open(sensor) as renderer:
        state, there = (
            WorldState({renderer.vehicle: base, "crate": crates[base.tobytes()]})
            for base in (now, other)
        )
        return renderer.render(state, also=also, next_state=there, previous_state=there)


def test_backward_flow_to_a_pose_is_the_forward_flow_to_it(stage):
    """Bit for bit: what holds for one, Embree's rays included, holds for the other."""
    frame = _frame(stage, LENSES["mirror"], NOW, AFTER, FLOWS)
    for forward, backward in (("flow", "flow_backward"), ("occluded", "occluded_backward")):
        np.testing.assert_array_equal(frame.channels[forward], frame.channels[backward])
    assert frame.metadata["next_world_from_base"] == AFTER.tolist()
    assert frame.metadata["previous_world_from_base"] == AFTER.tolist()


@lenses
def test_forward_and_backward_flow_cancel(stage, lens):
    """Visible points, on one plane; between pixels the backward flow is interpolated."""
    here = _frame(stage, lens, NOW, AFTER, ("flow", "instance")).channels
    there = _frame(stage, lens, AFTER, NOW, ("flow_backward", "instance", "normals")).channels
    ends = pixel_grid(lens.width_px, lens.height_px) + here["flow"]
    ends = np.nan_to_num(ends, nan=-1.0)
    corner, weights, inside = corner_and_weights(ends, ends.shape[:2])
    steps = (0, 1, lens.width_px, lens.width_px + 1)
    flat = there["flow_backward"].reshape(-1, 2)
    corners = [corner + step for step in steps]
    around = np.stack([flat.take(c, 0, mode="clip") for c in corners])
    back = np.sum(weights[..., None] * around, axis=0)
    known = np.isfinite(around).all(axis=(0, -1))  # at the rim a pixel's point was not yet seen
    # one plane of one object around the end, and the same object at the start
    plane = np.concatenate((there["normals"], there["instance"][..., None]), axis=-1)
    around = np.stack([plane.reshape(-1, 4).take(c, 0, mode="clip") for c in corners])
    smooth = inside & known & np.all(np.ptp(around, axis=0) < 1e-3, axis=-1)
    smooth &= (here["instance"] == around[0, ..., 3]) & (here["occluded"] == VISIBLE)
    if isinstance(lens, EquirectangularCamera):  # near the poles no interpolation is good
        smooth[:30] = smooth[90:] = False
    off_px = np.linalg.norm(here["flow"] + back, axis=-1)[smooth]
    moved = here["instance"][smooth] == here["instance"].max()
    assert smooth.mean() > 0.4
    assert moved.sum() > 100
    assert off_px.max() < 5e-3  # 2e-3 were measured: the flow's curvature between pixels


@lenses
def test_scene_flow_reprojected_is_the_optical_flow(stage, lens):
    also = (*FLOWS, "range", "position")
    found = _frame(stage, lens, NOW, AFTER, also).channels
    pixels = pixel_grid(lens.width_px, lens.height_px)
    rays = lens.ray_from_pixel(pixels)
    known = rays.valid & np.isfinite(found["flow"]).all(axis=-1)
    after = AFTER[:3, :3] @ lens.rig_from_optical
    ranges_m = found["range"][known, None].astype(np.float64)
    by_camera = ranges_m * rays.directions[known] + found["scene_flow_camera"][known]
    by_world = (found["position"] + found["scene_flow"])[known] - AFTER[:3, 3]
    for points in (by_camera, by_world @ after):
        off = lens.pixel_from_ray(points).positions_px - (pixels + found["flow"])[known]
        if isinstance(lens, EquirectangularCamera):
            off[:, 0] -= lens.width_px * np.round(off[:, 0] / lens.width_px)
        assert np.abs(off).max() < 1e-3  # range and flow are float32
    assert np.isnan(found["scene_flow"][~rays.valid]).all()


def test_scene_flow_is_the_rigid_motion_of_each_object(stage):
    """Exactly 0 on the static scene; the crate's own motion on the crate."""
    also = ("scene_flow", "position", "instance")
    found = _frame(stage, LENSES["sphere"], NOW, AFTER, also).channels
    on_crate = found["instance"] == found["instance"].max()
    assert on_crate.sum() > 300
    np.testing.assert_array_equal(found["scene_flow"][~on_crate], 0.0)
    points = found["position"][on_crate]
    then = CRATE_AFTER @ np.linalg.inv(CRATE_NOW)
    expected = points @ then[:3, :3].T + then[:3, 3] - points
    np.testing.assert_allclose(found["scene_flow"][on_crate], expected, atol=1e-7)
