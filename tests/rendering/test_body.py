"""A body that moves with the vehicle: against scenes in which it stands where the vehicle is."""

import dataclasses

import numpy as np
import pytest

from omnisim import OmniCamera, Stage, open_sensor
from omnisim.core.poses import pose
from omnisim.scene import load_scene
from omnisim.scene.model import AlphaMode, Lighting, Material
from tests.scenes import room, scene_of, square
from tests.vehicles import (
    BASE_FROM_SCANNER,
    CAMERA,
    POSES,
    SCANNER,
    body,
    box,
    merged,
    mounted_on_p2at,
    moved,
    p2at_body,
    surroundings,
    without,
)

pytestmark = pytest.mark.usefixtures("needs_opengl")


def image(scene, world_from_base, **options):
    with _opened(scene, CAMERA, **options) as renderer:
        return renderer.render(world_from_base).rgba


def ranges(scene, world_from_base, **options):
    with _scanner(scene, **options) as renderer:
        return renderer.scan(world_from_base).ranges_m


def _scanner(scene, **options):
    return _opened(scene, SCANNER, base_from_sensor=BASE_FROM_SCANNER, **options)


def _opened(scene, sensor, **options):
    """Renderer on a stage, or on one of its own."""
    if isinstance(scene, Stage):
        return scene.open(sensor, **options)
    return open_sensor(scene, sensor, **options)


@pytest.mark.parametrize(
    ("offset_m", "names"), [((0.0, 0.0, 0.0), list(POSES)[1:]), ((4e5, -3e6, 20.0), ["tilted"])]
)
def test_body_renders_as_the_same_static_geometry(offset_m, names):
    """All poses with one renderer: what it draws is that of the pose, not of the one before."""
    world_from_scene = pose(offset_m)
    scene = moved(surroundings(), world_from_scene)
    empty = image(scene, world_from_scene @ POSES["tilted"])
    with Stage(scene, body()) as stage:
        camera, scanner = stage.open(CAMERA), _scanner(stage)
        for name in names:
            base = world_from_scene @ POSES[name]
            rgba, scan = camera.render(base).rgba, scanner.scan(base)
            with Stage(merged(scene, body(), base)) as one:
                expected, expected_m = image(one, base), ranges(one, base)
            # one rounding in float32, of a normal, is at most one step of 8 bits
            difference = np.abs(rgba.astype(int) - expected)
            assert difference.max() <= 1, name
            assert np.count_nonzero(difference) < 1e-3 * difference.size, name
            np.testing.assert_array_equal(scan.ranges_m, expected_m, err_msg=name)
            assert scan.ranges_m.min() < 0.3, name  # it is the body
            if name == "tilted":
                changed = np.any(rgba != empty, axis=-1)
                assert 0.05 < changed.mean() < 0.7


def test_body_moves_with_the_vehicle():
    """Nothing but the body is near: its image is the same wherever the vehicle is."""
    nothing = without(scene_of([room(), box("far", 0)], [Material()]), "object 0")
    nothing = moved(nothing, pose((1e5, 0.0, 0.0)))
    with open_sensor(nothing, CAMERA, body=body()) as renderer:
        at_origin = renderer.render(pose()).rgba
        far = renderer.render(pose((700.0, -3e4, 5.0))).rgba
    assert np.ptp(at_origin[at_origin[..., 3] > 0][:, :3]) > 100
    np.testing.assert_array_equal(at_origin, far)
    with _scanner(nothing, body=body()) as scanner:
        seen = []
        for base in POSES.values():
            scan = scanner.scan(base)
            seen.append(scan.ranges_m)
    assert 10 < np.isfinite(seen[0]).sum() < len(seen[0])
    for one in seen[1:]:
        np.testing.assert_array_equal(np.isfinite(one), np.isfinite(seen[0]))
        hit = np.isfinite(one)
        np.testing.assert_allclose(one[hit], seen[0][hit], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("hidden", [{"tail", "tube"}, {"cage", "hull", "box"}])
def test_hidden_instances_are_hidden_from_one_sensor(hidden):
    scene, base = surroundings(), POSES["tilted"]
    # their shadows are not
    scene = dataclasses.replace(scene, lighting=scene.lighting.with_shadows(False))
    rest = without(body(), *hidden)
    with Stage(scene, body()) as stage:
        one, other = stage.open(CAMERA, hidden=hidden), stage.open(CAMERA)
        frame, whole = one.render(base), other.render(base).rgba
        scan = _scanner(stage, hidden=hidden).scan(base)
    with Stage(scene, rest) as stage:
        np.testing.assert_array_equal(frame.rgba, image(stage, base))
        np.testing.assert_array_equal(scan.ranges_m, ranges(stage, base))
    np.testing.assert_array_equal(whole, image(scene, base, body=body()))
    assert np.any(frame.rgba != whole)
    for taken in (scan, frame):
        assert (taken.metadata["hidden"], taken.metadata["body"]) == (sorted(hidden), "body")
        assert taken.metadata["world_from_base"] == base.tolist()


@pytest.mark.parametrize("is_body_nearer", [True, False])
def test_glass_of_scene_and_body_blends_back_to_front(is_body_nearer):
    def glass(red, green, alpha):
        return Material("", (red, green, 0.0, alpha), alpha_mode=AlphaMode.BLEND)

    floor = square(1.0, -3.0, 1, "floor")
    scene = scene_of([square(1.0, -2.0, name="window"), floor], [glass(1, 0, 0.25), Material()])
    vehicle = scene_of([square(1.0, 0.0, name="tube")], [glass(0, 1, 0.5)])
    sensor = OmniCamera(polygons=None, base_from_rig=pose((0.0, 0.0, 0.5))).resized(91)
    red, green = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    if is_body_nearer:
        expected = 0.5 * green + 0.5 * (0.25 * red + 0.75 * np.ones(3))
        base = pose((0.0, 0.0, -1.5))
    else:  # the window is between the vehicle's tube and its camera
        expected = 0.25 * red + 0.75 * (0.5 * green + 0.5 * np.ones(3))
        base = pose((0.0, 0.0, -2.25))
    with open_sensor(scene, sensor, body=vehicle) as renderer:
        color = renderer.render(base, linear=True).linear[45, 45]
    np.testing.assert_allclose(color, expected, atol=2e-3)


def test_lights_and_background_come_from_the_scene():
    scene = dataclasses.replace(
        scene_of([box("far", 0)], lighting=Lighting((0.5, 0.5, 0.5), ())), background=(0, 0, 1)
    )
    scene = moved(scene, pose((50.0, 0.0, 0.0)))
    vehicle = scene_of([square(1.0, 0.0, name="deck")], lighting=Lighting((9.0, 0.0, 0.0), ()))
    sensor = OmniCamera(polygons=None, base_from_rig=pose((0.0, 0.0, 1.0))).resized(91)
    with open_sensor(scene, sensor, body=vehicle) as renderer:
        linear = renderer.render(pose(), linear=True).linear
    np.testing.assert_allclose(linear[45, 45], 0.5, atol=1e-3)
    np.testing.assert_allclose(linear[45, 2], (0, 0, 1), atol=1e-3)


def test_p2at_is_visible_in_the_middle_only():
    """Its README: camera, deck, and the laser scanner out to 57 degrees from straight down."""
    camera, _ = mounted_on_p2at(240)
    camera = camera.with_polygons(None)
    v, u = np.mgrid[:240, :240]
    rays = camera.model.ray_from_pixel(np.stack((u, v), axis=-1).astype(float))
    theta_deg = np.full((240, 240), 180.0)
    theta_deg[rays.valid] = np.degrees(np.arccos(-rays.directions[rays.valid][:, 2]))
    scene = load_scene("courtyard", sky="none")
    with Stage(scene, p2at_body()) as stage, open_sensor(scene, camera) as alone:
        renderer = stage.open(camera)
        no_scanner = stage.open(camera, hidden={"lms200"})
        for base in (pose(), pose((1.5, -2.0, 0.0), roll_deg=3.0, pitch_deg=-4.0, yaw_deg=70.0)):
            ours = renderer.render(base).rgba
            is_body = np.any(ours != alone.render(base).rgba, axis=-1)
            assert np.all(is_body[theta_deg < 19.0])
            assert 50.0 < theta_deg[is_body].max() < 60.0
            # the laser scanner is ahead: at the top of the image, in the middle
            rows, columns = np.nonzero(np.any(ours != no_scanner.render(base).rgba, axis=-1))
            assert rows.max() < 110
            assert 100 < columns.min() < columns.max() < 140


def test_p2at_scanner_does_not_hit_the_robot():
    _, base_from_scanner = mounted_on_p2at(64)
    scene = load_scene("courtyard", sky="none")
    mount = {"base_from_sensor": base_from_scanner}
    with (
        Stage(scene, p2at_body()) as stage,
        stage.open(SCANNER, hidden={"lms200"}, **mount) as scanner,
        stage.open(SCANNER, **mount) as blind,
        open_sensor(scene, SCANNER, **mount) as alone,
    ):
        for base in (pose(), pose((1.5, -2.0, 0.0), roll_deg=3.0, pitch_deg=-4.0, yaw_deg=70.0)):
            scan = scanner.scan(base)
            np.testing.assert_array_equal(scan.ranges_m, alone.scan(base).ranges_m)
            assert scan.hit.sum() > 100
            assert blind.scan(base).ranges_m.max() < 0.2  # its own housing
