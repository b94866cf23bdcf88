"""Channels of ground truth: against rooms that are computed, vehicles that move, and Embree."""

import numpy as np
import pytest

from omnisim import OmniCamera, Stage, cameras, load_scene, open_sensor
from omnisim.cameras import EquirectangularCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.errors import OutputError, SceneError
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.rendering.truth import INVALID, OCCLUDED, OUTSIDE, VISIBLE
from omnisim.scene.model import AlphaMode, Material
from tests import embree_oracle
from tests.ray_casting import opaque_part
from tests.rendering.frames import frame_of
from tests.rendering.opengl.sheets import sheet
from tests.scenes import (
    ROOM_HALF_M,
    room,
    room_color,
    room_hit,
    scene_of,
    square,
    with_warehouse,
)  # fmt: skip
from tests.slow import slow_but
from tests.vehicles import body, box, checkered, surroundings

pytestmark = pytest.mark.usefixtures("needs_opengl")

POSE = pose((0.3, -0.4, 0.1), roll_deg=12.0, pitch_deg=-20.0, yaw_deg=33.0)
LENSES = {
    "mirror": cameras.HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 120, 120),
    "fisheye": cameras.EquidistantCamera(120, 100, 30.0, (58.5, 50.25)),
    "cylinder": cameras.CylindricalCamera(126, 40, 20.0, (62.5, 19.5)),
    "sphere": EquirectangularCamera(120, 60),
}
WIDE = EquirectangularCamera(240, 120)
# Rays are float32 on the GPU, 1e-6 off; a wall that a ray grazes is off by some times as much.
CLOSE_M = 2e-5
lenses = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())


def _truth(lens, also, now=POSE, after=None, scene=None, **sensor):
    camera = OmniCamera(lens, polygons=None, supersampling=1, **sensor)
    return frame_of(scene or scene_of([room()]), camera, now, also=also, next_state=after)


def _rays_world(lens, now=POSE):
    rays = lens.ray_from_pixel(pixel_grid(lens.width_px, lens.height_px))
    return rays.directions @ lens.rig_from_optical.T @ now[:3, :3].T, rays.valid


@lenses
def test_channels_of_a_room_are_those_of_the_exact_rays(lens):
    """Every pixel, also those beside the edges of the room and of the cube's faces."""
    also = tuple(name for name in CHANNELS if not CHANNELS[name].other)
    found = _truth(lens, also).channels
    directions, valid = _rays_world(lens)
    np.testing.assert_array_equal(found["valid"] > 0, valid)
    hits = room_hit(POSE[:3, 3], directions)
    ranges_m = np.linalg.norm(hits - POSE[:3, 3], axis=-1)
    np.testing.assert_allclose(found["range"][valid], ranges_m[valid], atol=CLOSE_M)
    np.testing.assert_allclose(found["position"][valid], hits[valid], atol=CLOSE_M)
    optical = (hits - POSE[:3, 3]) @ POSE[:3, :3] @ lens.rig_from_optical
    np.testing.assert_allclose(found["z"][valid], optical[valid][:, 2], atol=CLOSE_M)
    # the wall that is hit is the one whose coordinate is full; in an edge both are
    walls = np.argmax(np.abs(hits) / ROOM_HALF_M, axis=-1)
    normals = -np.sign(np.take_along_axis(hits, walls[..., None], -1)) * np.eye(3)[walls]
    clear = valid & (np.sort(np.abs(hits) / ROOM_HALF_M, axis=-1)[..., 1] < 1.0 - 1e-4)
    np.testing.assert_allclose(found["normals"][clear], normals[clear], atol=1e-6)
    in_camera = normals @ POSE[:3, :3] @ lens.rig_from_optical
    np.testing.assert_allclose(found["normals_camera"][clear], in_camera[clear], atol=1e-6)
    assert set(np.unique(found["instance"])) == {*np.unique(valid).astype(int)}
    assert found["semantic"][valid].min() == found["semantic"][valid].max() == 1
    nothing = ~valid
    for name, values in found.items():
        assert values.dtype == CHANNELS[name].dtype, name
        assert np.array_equal(
            values[nothing], np.full_like(values[nothing], CHANNELS[name].empty), equal_nan=True
        ), name
    # albedos are those of an adjacent texel, up to 1.5 texels away, in steps of 8 bits
    step = np.abs(found["albedo"] - room_color(hits))[clear].max(axis=-1)
    assert np.mean(step) < 0.01
    assert np.percentile(step, 99) < 0.05


def test_hits_are_between_the_near_and_the_far_plane():
    scene = scene_of([box("crate", 0, half_m=0.2), room()])
    frame = _truth(LENSES["sphere"], ("range",), pose(), scene=scene, near_m=0.3, far_m=2.5)
    ranges_m = frame.channels["range"]
    directions, _ = _rays_world(LENSES["sphere"], pose())
    room_m = np.linalg.norm(room_hit(np.zeros(3), directions), axis=-1)
    depth_m = room_m * np.abs(directions).max(axis=-1)  # along the axis of the face that sees it
    inside = np.abs(depth_m - 2.5) > 1e-3
    expected = np.where(depth_m < 2.5, room_m, np.inf)
    np.testing.assert_allclose(ranges_m[inside], expected[inside], rtol=1e-4)


def test_a_plain_of_kilometers_reaches_through_the_near_plane_to_its_end():
    """Two triangles, most of whose corners are behind any one face."""
    half_m = 2000.0
    lens, now = LENSES["sphere"], pose((3.3, 1.7, 1.0))
    ranges_m = _truth(lens, ("range",), now, scene=scene_of([square(half_m)])).channels["range"]
    directions, _ = _rays_world(lens, now)
    down = np.minimum(directions[..., 2], -1e-9)
    ends = now[:2, 3] - directions[..., :2] / down[..., None]
    seen = (directions[..., 2] < 0.0) & np.all(np.abs(ends) < half_m, axis=-1)
    np.testing.assert_array_equal(np.isfinite(ranges_m), seen)
    np.testing.assert_allclose(ranges_m[seen], -1.0 / down[seen], rtol=1e-6)


def test_rays_pass_through_holes_of_masked_surfaces():
    """A checkered cage around the camera: whole squares, away from their edges, ray by ray."""
    cage = Material(texture=checkered(0), alpha_mode=AlphaMode.MASK, double_sided=True)
    scene = scene_of([room(), box("cage", 1, half_m=0.6)], [Material(double_sided=True), cage])
    frame = _truth(WIDE, ("instance", "range"), pose(), scene=scene)
    directions, _ = _rays_world(WIDE, pose())
    axes = np.argmax(np.abs(directions), axis=-1)
    turned = np.take_along_axis(directions, (axes[..., None] + np.arange(3)) % 3, axis=-1)
    turned /= np.abs(turned[..., :1])  # (sign, sign (2u - 1), 2v - 1), see `box`
    squares = 4.0 * (np.stack((turned[..., 0] * turned[..., 1], turned[..., 2]), axis=-1) + 1.0)
    clear = np.all(np.abs(squares - np.floor(squares) - 0.5) < 0.25, axis=-1)
    column, row = np.moveaxis(np.clip(np.floor(squares), 0, 7).astype(int), -1, 0)
    is_hole = (row + column) % 2 == 0
    assert 0.3 < is_hole[clear].mean() < 0.7
    seen = np.where(is_hole, 1, 2)  # object 0 is the room
    np.testing.assert_array_equal(frame.channels["instance"][clear], seen[clear])
    cage_m = 0.6 / np.abs(directions).max(axis=-1)
    room_m = np.linalg.norm(room_hit(np.zeros(3), directions), axis=-1)
    expected_m = np.where(is_hole, room_m, cage_m)
    np.testing.assert_allclose(frame.channels["range"][clear], expected_m[clear], atol=CLOSE_M)


def test_blended_surfaces_are_hit_from_half_opacity_on():
    glass = Material(base_color=(0, 0, 1, 0.4), alpha_mode=AlphaMode.BLEND, double_sided=True)
    tinted = Material(base_color=(0, 0, 1, 0.6), alpha_mode=AlphaMode.BLEND, double_sided=True)
    meshes = [room(), box("glass", 1, half_m=0.6), box("tinted", 2, half_m=0.8)]
    scene = scene_of(meshes, [Material(double_sided=True), glass, tinted])
    frame = _truth(LENSES["sphere"], ("instance", "range"), pose(), scene=scene)
    names = [label.name for label in frame.labels.instances]
    seen = {names[number - 1] for number in np.unique(frame.channels["instance"])}
    assert seen == {"object 2"}
    assert 0.79 < frame.channels["range"].min() < 0.81


def test_sorted_blended_triangles_are_hit_where_they_are():
    """Triangles of blended surfaces are drawn from far to near, in another order at every pose."""
    glass = Material(base_color=(0, 0, 1, 0.6), alpha_mode=AlphaMode.BLEND)
    solid = Material(base_color=(0, 0, 1, 1.0))
    also = ("range", "normals", "instance")
    poses = [pose((0.9, 0.8, 0.7)), pose((-1.0, 0.3, -0.9), yaw_deg=20.0)]
    found = []
    for material in (glass, solid):
        meshes = [room(), box("box", 1, half_m=0.5)]
        scene = scene_of(meshes, [Material(double_sided=True), material])
        with open_sensor(scene, OmniCamera(WIDE, supersampling=1)) as renderer:
            found += [renderer.render(now, also=also).channels for now in poses]
    for of_glass, of_solid in zip(found[:2], found[2:], strict=True):
        assert (of_solid["instance"] == 2).sum() > 500
        for name in also:
            # neighbors of glass are not searched: pixels beside its edges may show what is behind
            same = (of_glass[name] == of_solid[name]).reshape(*of_solid["range"].shape, -1).all(-1)
            assert same.mean() > 0.999


def _render_all(renderer):
    previous = POSE @ pose((-0.1, 0.02, 0.0), yaw_deg=3.0)
    return renderer.render(POSE, also=tuple(CHANNELS), next_state=pose(), previous_state=previous)


def test_culling_changes_no_channel(monkeypatch):
    also = tuple(CHANNELS)
    found = []
    for worth in (0, 10**9):  # triangles from which on it is worth a test what is hidden
        monkeypatch.setattr(
            "omnisim.rendering.opengl.scene_view.MIN_TRIANGLES_OF_PASSES", (worth,) * 2
        )
        with open_sensor(surroundings(), OmniCamera().resized(90)) as renderer:
            found.append(_render_all(renderer).channels)
    for name in also:
        np.testing.assert_array_equal(*(channels[name] for channels in found))


def test_the_body_is_seen_but_for_hidden_instances():
    sensor = OmniCamera(
        LENSES["sphere"], polygons=None, base_from_rig=pose((-0.1, 0.05, 0.6)), supersampling=1
    )
    scene, vehicle = surroundings(), body()
    both = {}
    for hidden in ((), ("hull",)):
        with open_sensor(scene, sensor, body=vehicle, hidden=hidden) as renderer:
            frame = renderer.render(pose((0.2, 0.1, -1.0)), also=("instance", "semantic", "range"))
        label = {
            label.name: label for label in frame.labels.instances if label.object_name == "body"
        }
        mine = frame.channels["instance"] == label["hull"].id
        classes = {c.id: c.name for c in frame.labels.classes}
        assert classes[label["hull"].class_id] == "vehicle"
        assert {classes[n] for n in np.unique(frame.channels["semantic"][mine])} <= {"vehicle"}
        both[hidden] = mine.sum(), frame.channels["range"][mine]
    assert both[()][0] > 100
    assert both[("hull",)][0] == 0
    assert both[()][1].max() < 1.0  # m: it is under the camera


@lenses
def test_flow_is_the_reprojection_of_the_exact_hits(lens):
    after = POSE @ pose((0.2, -0.1, 0.05), yaw_deg=7.0, pitch_deg=2.0)
    frame = _truth(lens, ("flow",), after=after)
    directions, valid = _rays_world(lens)
    hits = room_hit(POSE[:3, 3], directions)
    there = lens.pixel_from_ray((hits - after[:3, 3]) @ after[:3, :3] @ lens.rig_from_optical)
    expected = there.positions_px - pixel_grid(lens.width_px, lens.height_px)
    period_px = {"equirectangular": 120.0, "cylindrical": 2 * np.pi * 20.0}.get(lens.model_name)
    if period_px is not None:
        expected[..., 0] -= period_px * np.round(expected[..., 0] / period_px)
    flow = frame.channels["flow"]
    known = valid & there.valid
    np.testing.assert_array_equal(np.isfinite(flow).all(axis=-1), known)
    # a pole of the image turns the rays' error of 1e-6 into that much more
    off_px = np.linalg.norm(flow - expected, axis=-1)[known]
    assert np.percentile(off_px, 99) < 1e-3
    assert off_px.max() < 0.05
    occlusion = frame.channels["occluded"]
    inside = known & np.all((there.positions_px >= -0.5), axis=-1)
    inside &= np.all(there.positions_px < (lens.width_px - 0.5, lens.height_px - 0.5), axis=-1)
    assert (occlusion[~valid] == INVALID).all()
    assert (occlusion[inside] == VISIBLE).all()  # a room occludes nothing of itself
    assert (occlusion[valid & ~inside] == OUTSIDE).all()


def test_flow_and_occlusion_of_a_dynamic_object():
    """A crate that slides, seen by a camera that drives; checked pixel by pixel, with geometry."""
    crate = scene_of([box("crate", 0, half_m=0.25)])
    now, after = pose((-1.0, 0.0, 0.0)), pose((-0.95, 0.02, 0.0), yaw_deg=3.0)
    crate_now, crate_after = pose((0.2, 0.2, 0.1)), pose((0.2, -0.3, 0.1), yaw_deg=25.0)
    with (
        Stage(scene_of([room()]), dynamic_objects={"crate": crate}) as stage,
        stage.open(OmniCamera(WIDE, supersampling=1)) as renderer,
    ):
        frame = renderer.render(
            WorldState({renderer.vehicle: now, "crate": crate_now}),
            also=("flow", "instance", "position"),
            next_state=WorldState({renderer.vehicle: after, "crate": crate_after}),
        )
        with pytest.raises(SceneError, match="state: expected a pose of crate, got body"):
            renderer.render(now)
    labels = {label.name: label for label in frame.labels.instances if label.object_name == "crate"}
    on_crate = frame.channels["instance"] == labels["object 0"].id
    assert on_crate.sum() > 300
    points = frame.channels["position"]
    moved = points.copy()
    then = crate_after @ np.linalg.inv(crate_now)
    moved[on_crate] = points[on_crate] @ then[:3, :3].T + then[:3, 3]
    seen = WIDE.pixel_from_ray((moved - after[:3, 3]) @ after[:3, :3] @ WIDE.rig_from_optical)
    expected = seen.positions_px - pixel_grid(240, 120)
    expected[..., 0] -= 240 * np.round(expected[..., 0] / 240)
    np.testing.assert_allclose(frame.channels["flow"], expected, atol=2e-3)
    # a wall's point is occluded where the ray to it goes through the box, in the crate's frame
    crate_from_world = np.linalg.inv(crate_after)
    start = crate_from_world[:3, :3] @ after[:3, 3] + crate_from_world[:3, 3]
    ends = moved @ crate_from_world[:3, :3].T + crate_from_world[:3, 3]
    ways = np.where(np.abs(ends - start) < 1e-12, 1e-12, ends - start)
    near, far = np.sort(np.stack(((-0.25 - start) / ways, (0.25 - start) / ways)), axis=0)
    enters, leaves = near.max(axis=-1), far.min(axis=-1)
    occluded = (enters < leaves) & (enters > 0.0) & (enters < 1.0 - 1e-3)
    # rays that touch the box by a hair are judged either way
    doubtful = np.abs(enters - leaves) < 1e-4
    occlusion = frame.channels["occluded"]
    assert occluded.sum() > 150
    np.testing.assert_array_equal((occlusion == OCCLUDED)[~doubtful], occluded[~doubtful])


def test_infinitely_far_points_flow_by_rotation_alone():
    """In an empty world what is seen is infinitely far."""
    tiny = scene_of([box("far away", 0, half_m=1e-4)], poses=[pose((0.0, 0.0, -50.0))])
    lens, then = LENSES["sphere"], pose((3.0, 0.0, 0.0), yaw_deg=15.0)
    flow = _truth(lens, ("flow",), pose(), then, scene=tiny).channels["flow"]
    np.testing.assert_allclose(flow[..., 1], 0.0, atol=1e-3)
    # to the left by 15°: what is seen moves right by as many pixels
    np.testing.assert_allclose(flow[..., 0], 15.0 / 360.0 * lens.width_px, atol=1e-3)


def test_a_channel_does_not_depend_on_others_or_on_the_image():
    scene = surroundings()
    sensor = OmniCamera(polygons=64).resized(60)
    also = tuple(CHANNELS)
    with open_sensor(scene, sensor) as renderer:
        plain = renderer.render(POSE)
        alone = renderer.render(POSE, also=("range",))
        all_of_them = _render_all(renderer)
        again = renderer.render(POSE, also=("range",))
    assert tuple(all_of_them.channels) == also
    assert not plain.channels
    for frame in (alone, again):
        np.testing.assert_array_equal(frame.channels["range"], all_of_them.channels["range"])
    for frame in (alone, all_of_them):
        np.testing.assert_array_equal(frame.rgba, plain.rgba)
    for name, values in all_of_them.channels.items():
        assert values.dtype == CHANNELS[name].dtype
        assert values[0, 0].size == len(CHANNELS[name].layers)


def test_unknown_channels_and_flow_without_a_next_pose_are_refused():
    with open_sensor(scene_of([room()]), OmniCamera().resized(16)) as renderer:
        for also, words in (
            (("rang",), "'rang': there is no such channel; did you mean"),
            (("depth",), "did you mean 'range'"),
            (("flow",), "'flow': expected next_state, got none"),
            (("scene_flow", "scene_flow_camera"), "'scene_flow': expected next_state, got none"),
            (("flow_backward",), "'flow_backward': expected previous_state, got none"),
        ):
            with pytest.raises(OutputError, match=words):
                renderer.render(pose(), also=also)


@pytest.mark.parametrize("lens", slow_but(embree_oracle.LENSES, "mirror"))
@with_warehouse("mapping")
def test_hits_are_those_of_embree(source, lens):
    """One pose; the bounds are the project's, `tests.embree_oracle` takes more poses.

    Measured in three poses of mapping, the worst: 0.9994, 0, 0.001 px, 0.0001 px and 0.990.
    """
    scene = opaque_part(load_scene(source))
    oracle = embree_oracle.Oracle(scene)
    now = embree_oracle.free_poses(oracle, 1, *embree_oracle.FREE_M[source], seed=5)[0]
    with open_sensor(scene, embree_oracle.LENSES[lens]) as renderer:
        results = embree_oracle.compare(scene, oracle, renderer, now, embree_oracle.next_pose(now))
    assert min(results["range"], results["instance"], results["normals"]) >= 0.995
    assert results["wrong elsewhere"] <= 1e-4  # all others are at silhouettes
    assert results["flow mean px"] <= 0.02
    assert results["flow 99 % px"] <= 0.1
    assert results["occluded"] > 300
    assert results["occlusion F1"] >= 0.97


@pytest.mark.parametrize("lens", [LENSES["mirror"], LENSES["sphere"]])
def test_triangles_that_show_in_no_texel_have_an_albedo(lens):
    """Tiny triangles of one color before nothing: none of it is the black of nothing."""
    scene = scene_of(
        [sheet("sheet", 0, side=60, bumps_m=0.02, seed=seed) for seed in range(6)],
        [Material(base_color=(0.25, 1.0, 0.25, 1.0), double_sided=True)],
        [pose((x, y, -0.4), pitch_deg=10.0) for x in (-1.3, 0.1, 1.2) for y in (-0.9, 0.8)],
    )
    found = _truth(lens, ("albedo", "range"), scene=scene).channels
    hit = np.isfinite(found["range"])
    assert hit.any()
    assert not hit.all()
    # the square root has steps of 1/255, which halved are 0.002 for 0.25
    np.testing.assert_allclose(
        found["albedo"][hit], np.tile((0.25, 1.0, 0.25), (hit.sum(), 1)), atol=4e-3
    )
