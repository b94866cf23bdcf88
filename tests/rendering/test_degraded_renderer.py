"""Degraded cameras in a scene: shutter, exposure, and no change where they are ideal."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import PerspectiveCamera
from omnisim.core import poses
from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.core.random_numbers import key_of
from omnisim.rendering.camera.degradations import (
    Defocus,
    Degradation,
    Encoding,
    Exposure,
    Noise,
    Shutter,
    preset,
)
from omnisim.rendering.camera.degradations.encoding import eight_bits
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.rendering.twist import Twist
from omnisim.scene.model import Material
from tests.scenes import room, scene_of, upright

pytestmark = pytest.mark.usefixtures("needs_opengl")
FOCAL_PX, SIZE_PX = 60.0, (48, 32)
CAMERA = PerspectiveCamera(*SIZE_PX, FOCAL_PX, (23.5, 15.5))
TURN_RADPS = 1.2


def curtain():
    """White, in the plane x = 0, from y = 0 to the right; black to the left."""
    return scene_of([upright(20.0)], [Material(double_sided=True)], [poses.pose((0, -20.0, 0))])


def looking_ahead(shutter=None):
    # fine enough for an edge: 4 samples to a side of a pixel, 4 samples in each texel
    degradation = Degradation(shutter=shutter)
    return OmniCamera(CAMERA, supersampling=4, samples=4, degradation=degradation)


def edges_px(image):
    """Column (height,) at which the white begins, from the light in each row."""
    return SIZE_PX[0] - 0.5 - image[..., 0].sum(axis=1)


def middles_s(readout_s):
    """Times (height,) of the rows of a rolling shutter."""
    return (np.arange(SIZE_PX[1]) / (SIZE_PX[1] - 1) - 0.5) * readout_s


AHEAD = scene_of([]).added("curtain", curtain(), poses.pose((4.0, 0.0, 0.0)))


def _turning_left(shutter):
    with open_sensor(AHEAD, looking_ahead(shutter), unlit=True) as renderer:
        motion = Twist(angular_radps=(0.0, 0.0, TURN_RADPS)).through(np.eye(4))
        return renderer.render(np.eye(4), linear=True, motion=motion)


def _edge_px(times_s):
    """Exact column of the edge for a camera that rotates left: ever further to the right."""
    return 23.5 + FOCAL_PX * np.tan(TURN_RADPS * times_s)


@pytest.mark.parametrize("exposure_s", [None, 0.01])
def test_rolling_shutter_slants_an_edge_by_the_rotation(exposure_s):
    """A vertical edge, each row at its own time: to 0.1 px everywhere, 3.6 px aslant."""
    frame = _turning_left(Shutter(exposure_s=exposure_s, readout_s=0.05))
    instants_s = middles_s(0.05)[:, None] + np.linspace(-0.5, 0.5, 101) * (exposure_s or 0.0)
    expected = _edge_px(instants_s).mean(axis=1)
    seen = edges_px(frame.linear)
    assert np.abs(seen - expected).max() <= 0.1
    slant = np.polyfit(np.arange(SIZE_PX[1]), seen - expected, 1)[0] * SIZE_PX[1]
    assert abs(slant) <= 0.1
    assert seen[-1] - seen[0] > 3.3  # later rows see the edge further right: a turn to the left
    assert frame.metadata["degradation"]["sub_frames"] > 5


def test_exposure_blurs_an_edge_evenly_along_its_motion():
    frame = _turning_left(Shutter(exposure_s=0.06))
    first, last = _edge_px(np.array([-0.03, 0.03]))
    u = np.arange(SIZE_PX[0])
    # share of the exposure at which a pixel is white, pixels being as wide as they are
    fine = u[:, None] + np.linspace(-0.5, 0.5, 101)
    expected = np.clip((fine - first) / (last - first), 0.0, 1.0).mean(axis=1)
    assert np.abs(frame.linear[..., 0] - expected).max() < 0.03  # a quarter of a step of 0.5 px
    assert edges_px(frame.linear) == pytest.approx(23.5, abs=0.05)


def test_the_pose_is_that_of_the_middle_of_the_frame():
    """And at rest the shutter does nothing."""
    still = looking_ahead(Shutter(exposure_s=0.01, readout_s=0.02))
    with open_sensor(AHEAD, still, unlit=True) as renderer:
        at_rest = renderer.render(np.eye(4), linear=True)
        motion = Twist((0.0, 0.0, 0.0)).through(np.eye(4))
        again = renderer.render(np.eye(4), linear=True, motion=motion)
        assert at_rest.metadata["degradation"]["sub_frames"] == 1
    np.testing.assert_array_equal(at_rest.linear, again.linear)
    moving = _turning_left(Shutter(exposure_s=0.01, readout_s=0.02))
    assert edges_px(moving.linear)[15:17].mean() == pytest.approx(23.5, abs=0.1)


def test_twist_moves_along_an_arc():
    start = poses.pose((1.0, 2.0, 0.5), yaw_deg=90.0)
    motion = Twist((2.0, 0.0, 0.0), (0.0, 0.0, np.pi)).through(start)
    np.testing.assert_allclose(motion(0.0), start, atol=1e-15)
    # half a turn on a circle of radius 2/π to the left: ahead is +y, so the circle is at −x
    np.testing.assert_allclose(motion(1.0)[:3, 3], (1.0 - 4.0 / np.pi, 2.0, 0.5), atol=1e-12)
    np.testing.assert_allclose(motion(1.0)[:3, 0], (0.0, -1.0, 0.0), atol=1e-12)
    with pytest.raises(OmnisimError, match=r"twist\.linear_mps\.0: expected .*, got"):
        Twist((np.nan, 0.0, 0.0))


@pytest.mark.parametrize(("speed_mps", "turn_radps"), [(1.0, 0.0), (100.0, 0.1), (1e4, 1e3)])
def test_a_fast_and_long_motion_is_of_poses(speed_mps, turn_radps):
    motion = Twist((speed_mps, 0.0, 0.0), (0.0, 0.0, turn_radps)).through(np.eye(4))
    for time_s in np.linspace(-3.0, 3.0, 13):
        x, y = poses.check_pose(motion(float(time_s)))[:2, 3]
        chord_m = abs(speed_mps * time_s * np.sinc(0.5 * turn_radps * time_s / np.pi))
        # an arc's chord: float64 through thousands of radians
        np.testing.assert_allclose(np.hypot(x, y), chord_m, rtol=1e-9, atol=1e-9 * speed_mps)


def test_an_ideal_camera_has_the_same_image_and_no_more_passes():
    scene, pose = scene_of([room()]), np.eye(4)
    ideal = OmniCamera().resized(90)
    with Stage(scene) as stage, stage.open(ideal) as plain:
        expected = plain.render(pose, linear=True)
        assert plain._passes._degraded is None
        assert "degradation" not in expected.metadata
        with stage.open(ideal.with_degradation(preset("ideal")), seed=5) as other:
            same = other.render(pose, linear=True, frame_number=3)
            assert other._passes._degraded is None
        # the default encoding has the same bytes through the chain, too
        encoding = Degradation(encoding=Encoding())
        with stage.open(ideal.with_degradation(encoding)) as through:
            chain = through.render(pose, linear=True)
    np.testing.assert_array_equal(expected.rgba, same.rgba)
    np.testing.assert_array_equal(expected.linear, same.linear)
    assert expected.metadata == same.metadata
    assert np.abs(chain.rgba.astype(int) - expected.rgba).max() <= 1  # float32, not half floats


def test_noise_depends_on_seed_and_frame_alone():
    sensor = OmniCamera().resized(90).with_degradation(preset("bad-day"))
    pose = np.eye(4)
    with Stage(scene_of([room()])) as stage:
        with stage.open(sensor, seed=1) as one, stage.open(sensor, seed=1) as same:
            first = one.render(pose, frame_number=4)
            one.render(pose, frame_number=9)
            np.testing.assert_array_equal(first.rgba, one.render(pose, frame_number=4).rgba)
            np.testing.assert_array_equal(first.rgba, same.render(pose, frame_number=4).rgba)
            assert np.mean(first.rgba != same.render(pose, frame_number=5).rgba) > 0.3
        with stage.open(sensor, seed=2) as other:
            assert np.mean(first.rgba != other.render(pose, frame_number=4).rgba) > 0.3


@pytest.mark.parametrize("name", ["dragonfly2", "webcam", "bad-day"])
def test_presets_equal_their_reference_from_scene_to_file(name, tmp_path):
    degradation = preset(name)
    ideal = OmniCamera().resized(80)
    sensor = ideal.with_degradation(degradation)
    geometry = ImageGeometry.of_camera(sensor.model)
    with Stage(scene_of([room()])) as stage:
        with stage.open(ideal) as renderer:
            perfect = renderer.render(np.eye(4), linear=True)
        with stage.open(sensor, seed=3) as renderer:
            frame = renderer.render(np.eye(4), linear=True, frame_number=2)
    alpha = perfect.valid[..., None].astype(np.float32)
    whole = np.concatenate((perfect.linear, alpha), axis=-1)
    light = degradation.exposed([(whole, None)], geometry)
    ev = frame.metadata["degradation"]["exposure"]["ev"]
    key = key_of("noise", 3)
    expected = degradation.developed(light, geometry, degradation.exposure_factors(ev), key, 2)
    # the ideal image is in half floats: 2⁻¹¹ of the light, far below a photon's noise, but
    # some electrons fall on the other side, and some pixels of the JPEG with them
    deviation = np.sqrt(np.mean((frame.linear - expected[..., :3]) ** 2))
    assert deviation < 0.01
    encoded = eight_bits(expected, degradation.encoding)
    if degradation.jpeg is not None:
        encoded = degradation.jpeg.compressed(encoded)
    assert np.mean(np.abs(frame.rgba.astype(int) - encoded)) < 1.0
    np.testing.assert_array_equal(frame.valid, perfect.valid)
    assert not frame.rgb[~frame.valid].any()
    frame.save(tmp_path / "a.png")
    recorded = read_image(tmp_path / "a.png")[1]["degradation"]
    assert recorded["parameters"]["noise"]["full_well_e"] == degradation.noise.full_well_e
    assert recorded["noise"] == {"seed": 3, "frame_number": 2}


def test_exposure_doubles_light_and_auto_exposure_reaches_its_target():
    scene, pose = scene_of([room()]), np.eye(4)
    sensor = OmniCamera().resized(90)
    with Stage(scene) as stage:

        def linear(exposure, **options):
            with stage.open(sensor.with_degradation(Degradation(exposure=exposure))) as renderer:
                frame = renderer.render(pose, linear=True, **options)
            return frame.linear, frame.valid, frame.metadata["degradation"]["exposure"]

        plain, valid, _ = linear(Exposure())
        brighter, _, recorded = linear(Exposure(ev=1.0))
        np.testing.assert_allclose(brighter, 2.0 * plain, rtol=1e-6)
        assert recorded == {"ev": 1.0, "metered_ev": 1.0}
        seen, _, recorded = linear(Exposure(auto=True, target=0.1))
        luminance = seen[valid] @ (0.2126, 0.7152, 0.0722)
        assert np.median(luminance) == pytest.approx(0.1, rel=1e-4)
        seen, valid, _ = linear(Exposure(auto=True, target=0.1, metering="mean"))
        luminance = seen[valid] @ (0.2126, 0.7152, 0.0722)
        assert luminance.mean() == pytest.approx(0.1, rel=1e-4)
        lagging, _, late = linear(Exposure(auto=True, target=0.1), exposure_ev=0.0)
        np.testing.assert_allclose(lagging, plain, rtol=1e-6)
        assert late == {"ev": 0.0, "metered_ev": recorded["metered_ev"]}


def test_a_bright_window_does_not_move_the_meter():
    """It fills a fifth of the image, and is a thousand times as bright as the room."""
    image = np.full((50, 50, 4), (0.2, 0.2, 0.2, 1.0), dtype=np.float32)
    image[:10, :, :3] = 200.0
    room = Exposure(auto=True, min_ev=-20.0)
    assert room.meter.of_image(image) == pytest.approx(0.2)
    assert room.metered_ev(room.meter.of_image(image)) == pytest.approx(np.log2(0.18 / 0.2))
    mean = dataclasses.replace(room, metering="mean")
    assert mean.metered_ev(mean.meter.of_image(image)) == pytest.approx(np.log2(0.18 / 40.16))
    bright = dataclasses.replace(room, percentile=90.0)
    assert bright.meter.of_image(image) == pytest.approx(200.0)


def test_auto_exposure_lags_as_a_filter_of_first_order():
    exposure = Exposure(auto=True, time_constant_s=0.5, min_ev=-2.0, max_ev=3.0)
    ev = 0.0
    for _ in range(10):
        ev = exposure.next_ev(ev, 2.0, 0.1)
    assert ev == pytest.approx(2.0 * (1.0 - np.exp(-2.0)))
    assert Exposure(auto=True, time_constant_s=0.0).next_ev(0.0, 2.0, 0.1) == 2.0
    assert Exposure(ev=0.7).next_ev(0.0, 2.0, 0.1) == 0.7
    assert exposure.metered_ev(0.18) == 0.0
    assert exposure.metered_ev(0.0) == exposure.metered_ev(1e-9) == 3.0
    assert exposure.metered_ev(1e9) == -2.0


def test_defocus_comes_before_noise_and_motion_through_the_whole_chain():
    """The noise of a blurred image is not blurred."""
    sensor = OmniCamera().resized(90)
    both = Degradation(defocus=Defocus(3.0, 3.0), noise=Noise(full_well_e=500.0, read_noise_e=0.0))
    blurred = Degradation(defocus=Defocus(3.0, 3.0))
    with Stage(scene_of([room()])) as stage:
        images = []
        for degradation in (both, blurred):
            with stage.open(sensor.with_degradation(degradation)) as renderer:
                images.append(renderer.render(np.eye(4), linear=True))
    difference = (images[0].linear - images[1].linear)[30:60, 30:60, 1]
    shot = np.sqrt(images[1].linear[30:60, 30:60, 1].mean() / 500.0)
    assert difference.std() == pytest.approx(shot, rel=0.15)  # of 900: 3 σ are 7 %


@pytest.mark.parametrize(
    "degradation",
    [Degradation(), Degradation(shutter=Shutter(exposure_s=0.01), exposure=Exposure(auto=True))],
)
def test_impossible_exposures_and_motions_are_refused(degradation):
    sensor = OmniCamera().resized(16).with_degradation(degradation)
    with open_sensor(scene_of([room()]), sensor) as renderer:
        for exposure_ev in (np.nan, np.inf, 5000.0):
            with pytest.raises(OmnisimError, match=r"exposure_ev: expected −30 to 30 .*, got \w+"):
                renderer.render(np.eye(4), exposure_ev=exposure_ev)
        if not degradation.is_ideal:
            with pytest.raises(OmnisimError, match="pose: expected"):
                renderer.render(np.eye(4), motion=lambda time_s: np.eye(3))


def test_ground_truth_is_that_of_the_ideal_camera():
    """Whatever the degradation and the motion are."""
    ideal = OmniCamera().resized(60)
    also = ("range", "instance", "normals", "flow")
    pose, after = np.eye(4), poses.pose((0.1, 0.0, 0.0), yaw_deg=3.0)
    with Stage(scene_of([room()])) as stage:
        with stage.open(ideal) as renderer:
            truth = renderer.render(pose, also=also, next_state=after)
        with stage.open(ideal.with_degradation(preset("bad-day"))) as renderer:
            motion = Twist((1.0, 0.0, 0.0), (0.0, 0.0, 0.5)).through(pose)
            frame = renderer.render(pose, also=also, next_state=after, motion=motion)
            faces = renderer.faces()
    assert np.mean(frame.rgb != truth.rgb) > 0.3
    assert frame.channels.keys() == truth.channels.keys()
    for name, values in truth.channels.items():
        np.testing.assert_array_equal(frame.channels[name], values)
    assert "front" in faces
