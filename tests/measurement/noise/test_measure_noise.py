"""Noise measured from frames whose noise is known, and from folders of frames by exposure."""

import copy
import dataclasses

import numpy as np
import pytest

from omnisim.core.errors import MeasurementError, OpticsError
from omnisim.core.files.image_files import write_image, write_numbers
from omnisim.measurement.noise import (
    find_frame_sets,
    frame_statistics,
    measure_noise,
    read_statistics,
)
from omnisim.rendering.camera.degradations import Noise
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.noise import random_pattern
from tests.measurement.noise.frames import NOISE, TIMES_S, Camera, dark_and_flat

# Relative bounds: those asked of the measurement of any camera, for 640 × 480 frames and 50 per
# stack. Here 16 times fewer pixels and 3 times fewer frames suffice for them.
BOUNDS = {
    "gain_e_per_dn": 0.01,
    "read_noise_e": 0.03,
    "full_well_e": 0.03,
    "dark_current_e_per_s": 0.05,
    "dsnu_e": 0.05,
    "prnu": 0.05,
}


@pytest.fixture(scope="module")
def frames():
    return dark_and_flat(Camera())


@pytest.fixture(scope="module")
def measured(frames):
    return measure_noise(*frames)


def test_quantities_are_those_of_the_camera(measured):
    quantities = {quantity.name: quantity for quantity in measured.quantities}
    for name, bound in BOUNDS.items():
        quantity, true = quantities[name], getattr(NOISE, name)
        assert quantity.value == pytest.approx(true, rel=bound), name
        # 1e-3: the well is filled by noise, too, and normal numbers have the steps of float32
        assert abs(quantity.value - true) < 4.0 * quantity.sigma + 1e-3 * true, name


def test_the_sensor_file_has_what_was_measured(measured):
    values = {quantity.name: quantity.value for quantity in measured.quantities}
    for name in (*BOUNDS, "black_level_dn"):
        assert getattr(measured.noise, name) == values[name]
    assert measured.noise.bit_depth == 12
    assert values["black_level_dn"] == pytest.approx(40.0, abs=0.02)
    assert measured.unobservable == ()


def test_the_pattern_is_that_of_the_camera(measured):
    true = random_pattern(160, 120, NOISE.prnu, NOISE.dsnu_e, NOISE.pattern_seed)
    for channel in (0, 1):
        found, drawn = measured.pattern[..., channel].ravel(), true[..., channel].ravel()
        # with 16 frames, 0.73 and 0.92 of the variance is the pattern's: correlation 0.85 and 0.96
        assert np.corrcoef(found, drawn)[0, 1] > 0.8
        assert found.std() == pytest.approx(drawn.std(), rel=0.05)


def test_light_that_falls_off_is_no_pattern():
    """The trend of the light, here cos⁴ to 0.75 in the corners, is not the pixels'."""
    geometry = ImageGeometry(160, 120, (80.0, 60.0))
    light = 1.0 / (1.0 + 0.1 * geometry.squared_radii()) ** 2
    measured = measure_noise(*dark_and_flat(Camera(), flat_light=light))
    assert measured.noise.prnu == pytest.approx(NOISE.prnu, rel=0.05)


def test_colors_of_a_mosaic_are_no_pattern():
    light = np.ones((120, 160))
    light[::2, ::2], light[1::2, 1::2] = 0.6, 0.8
    frames = dark_and_flat(Camera(), flat_light=light)
    assert measure_noise(*frames, mosaic=True).noise.prnu == pytest.approx(NOISE.prnu, rel=0.05)
    assert measure_noise(*frames).noise.prnu > 0.1


def test_values_at_the_upper_end_of_16_bits_are_shifted():
    camera = Camera()

    def frames(light, time_s, count):
        shifted = (frame << 4 for frame in camera.frames(light, time_s, count))
        return frame_statistics(shifted, time_s)

    darks = [frames(0.0, time_s, 2) for time_s in TIMES_S[:2]]
    flats = [frames(time_s / TIMES_S[-1], time_s, 2) for time_s in TIMES_S[:6]]
    measured = measure_noise(darks, flats)
    assert measured.noise.gain_e_per_dn == pytest.approx(3.1, rel=0.02)
    assert measured.noise.black_level_dn == pytest.approx(40.0, abs=0.1)


def test_what_frames_do_not_determine_is_said():
    camera = Camera()
    dark = camera.statistics(0.0, 0.01)
    flats = [camera.statistics(light, 0.01) for light in (0.05, 0.1, 0.2, 0.4)]
    measured = measure_noise([dark], flats)
    unobservable = {one.name for one in measured.unobservable}
    assert unobservable == {"dark_current_e_per_s", "full_well_e", "dsnu_e", "prnu"}
    assert measured.pattern is None
    assert measured.noise.dark_current_e_per_s == 0.0
    assert measured.noise.gain_e_per_dn == pytest.approx(3.1, rel=0.05)


def test_defective_pixels_are_found(frames):
    darks, flats = copy.deepcopy(frames)
    hot, dead = (7, 9), (100, 30)
    for dark in (*darks, *flats):
        dark.mean_image_dn[hot] += 200.0
        dark.mean_image_dn[dead] = 40.0
    assert measure_noise(darks, flats).defects.tolist() == [[7, 9], [100, 30]]


def test_pixels_without_noise_of_their_own_are_fine():
    """An ideal sensor: no read noise, no pattern."""
    noise = dataclasses.replace(NOISE, read_noise_e=0.0, prnu=0.0, dsnu_e=0.0)
    measured = measure_noise(*dark_and_flat(Camera(noise)))
    unobservable = {one.name: one.reason for one in measured.unobservable}
    assert {"prnu", "dsnu_e"} <= set(unobservable)
    assert "below" in unobservable["prnu"]


def _gamma_encoded(camera, light, time_s):
    """Statistics of two frames of gamma-encoded values."""
    frames = 4095.0 * (np.array(camera.frames(light, time_s)) / 4095.0) ** (1.0 / 2.2)
    return frame_statistics(np.rint(frames).astype(np.uint16), time_s)


def test_gamma_is_refused():
    camera = Camera()
    darks = [_gamma_encoded(camera, 0.0, time_s) for time_s in TIMES_S[:7]]
    flats = [_gamma_encoded(camera, time_s / TIMES_S[-1], time_s) for time_s in TIMES_S[:7]]
    with pytest.raises(MeasurementError, match=r"linear \(raw\) frames"):
        measure_noise(darks, flats)


def test_gamma_is_refused_at_one_exposure():
    camera = Camera(dataclasses.replace(NOISE, black_level_dn=5.0))
    lights = (0.0, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
    dark, *flats = (_gamma_encoded(camera, light, 0.01) for light in lights)
    message = r"variance falls while the mean grows .* linear \(raw\) frames"
    with pytest.raises(MeasurementError, match=message):
        measure_noise([dark], flats)


def test_denoised_frames_are_refused():
    """A filter that smooths bright frames more: as many frames averaged as the light is strong."""
    camera = Camera()
    flats = []
    for light in (0.02, 0.05, 0.1, 0.2, 0.4):
        groups = [camera.frames(light, 0.01, 1 + round(4 * light)) for _ in range(2)]
        frames = np.mean(groups, axis=1).astype(np.uint16)
        flats.append(frame_statistics(frames, 0.01))
    with pytest.raises(MeasurementError, match=r"variance per mean changes by -\d+ %.*denoising"):
        measure_noise([camera.statistics(0.0, 0.01)], flats)


def test_a_light_leak_is_refused(frames):
    darks, flats = frames
    light = np.zeros((120, 160))
    light[:30, :40] = 0.05
    leak = Camera().statistics(light, 0.01, name="dark/leak")
    message = r"dark/leak: .* more at the upper left: light leaks"
    with pytest.raises(MeasurementError, match=message):
        measure_noise([leak, *darks], flats)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda darks, flats: ([], flats), "got no dark ones"),
        (lambda darks, flats: (darks, []), "got no flat ones"),
        (lambda darks, flats: (flats, darks), "flats brighter than the dark frames"),
        (lambda darks, flats: (darks, darks), "flats brighter than the dark frames"),
        (lambda darks, flats: (darks, flats[:2]), "at least 3 flat levels below 70 %"),
        (lambda darks, flats: (darks, flats[-2:] * 3), "below 70 % of saturation, got 0 of 6"),
        (lambda darks, flats: (darks, flats[3:6]), "span a ratio of 4"),
    ],
)  # fmt: skip
def test_frames_of_which_nothing_can_be_measured_are_refused(change, message):
    darks, flats = dark_and_flat(Camera(size=(40, 30)), stack_count=2)
    with pytest.raises(MeasurementError, match=message):
        measure_noise(*change(darks, flats))


def test_clipped_darks_and_sizes_are_refused():
    clipped = Camera(dataclasses.replace(NOISE, black_level_dn=0.0))
    with pytest.raises(MeasurementError, match=r"at 0, got .* %: raise the camera's black level"):
        measure_noise(*dark_and_flat(clipped, TIMES_S[:4]))
    darks, flats = dark_and_flat(Camera(size=(40, 30)), TIMES_S[:4], stack_count=2)
    other = Camera(size=(40, 32)).statistics(0.2, 0.01, name="flat/other")
    with pytest.raises(MeasurementError, match=r"flat/other: expected 40 × 30 px .*got 40 × 32 px"):
        measure_noise(darks, [*flats, other])
    with pytest.raises(MeasurementError, match="bit depth 8: expected at least 12"):
        measure_noise(darks, flats, bit_depth=8)
    with pytest.raises(MeasurementError, match="frames: expected at least 2 frames, got 1"):
        frame_statistics([np.zeros((2, 2), np.uint8)], 0.01)
    with pytest.raises(MeasurementError, match="frames of one size, got 2 × 2 and 3 × 2 px"):
        frame_statistics([np.zeros((2, 2), np.uint8), np.zeros((2, 3), np.uint8)], 0.01)


def test_noise_has_a_pattern_or_its_spread():
    with pytest.raises(OpticsError, match=r"noise\.pattern: expected none with prnu or dsnu_e"):
        Noise(pattern="a.exr", prnu=0.1)


def test_exposures_are_the_folders_names(tmp_path):
    for folder in ("10ms", "2.5ms-bright", "1s", "400us"):
        (tmp_path / folder).mkdir()
        write_numbers(tmp_path / folder / "0.png", np.zeros((2, 3), np.uint16))
    (tmp_path / "notes.txt").write_text("lamp at 3 m")
    exposures = [one.exposure_s for one in find_frame_sets(tmp_path)]
    assert exposures == pytest.approx([400e-6, 2.5e-3, 10e-3, 1.0])


def test_statistics_are_those_of_the_files(tmp_path):
    frames = np.random.default_rng(1).integers(100, 4000, (3, 20, 30)).astype(np.uint16)
    (tmp_path / "10ms").mkdir()
    for number, frame in enumerate(frames):
        write_numbers(tmp_path / "10ms" / f"{number}.png", frame)
    statistics = read_statistics(find_frame_sets(tmp_path)[0])
    values = frames.astype(np.float64)
    drift = values.mean(axis=(1, 2)).var(ddof=1)
    assert statistics.count == 3
    assert statistics.exposure_s == pytest.approx(0.01)
    np.testing.assert_allclose(statistics.mean_image_dn, values.mean(axis=0), rtol=1e-14)
    assert statistics.variance_dn2 == pytest.approx(values.var(axis=0, ddof=1).mean() - drift)
    assert statistics.maximum_dn == frames.max()
    assert statistics.clipped == pytest.approx(np.mean(frames == frames.max()))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("exposure_3/0.png", r"exposure_3: expected an exposure time as name, such as 2\.5ms"),
        ("3ms/0.jpg", r"0\.jpg: lossy compression changes the noise: save PNG or TIFF"),
        ("3ms/0.raw", r"0\.raw: expected images \(\.png \.tif \.tiff \.pgm\) only"),
    ],
)
def test_other_names_are_refused(tmp_path, name, message):
    path = tmp_path / name
    path.parent.mkdir()
    path.write_bytes(b"")
    with pytest.raises(MeasurementError, match=message):
        find_frame_sets(tmp_path)


def test_other_folders_and_files_are_refused(tmp_path):
    with pytest.raises(MeasurementError, match="got none"):
        find_frame_sets(tmp_path)
    with pytest.raises(MeasurementError, match="expected a folder with one folder per exposure"):
        find_frame_sets(tmp_path / "none")
    broken = tmp_path / "1ms" / "0.png"
    broken.parent.mkdir()
    broken.write_bytes(b"")
    with pytest.raises(MeasurementError, match=r"0\.png: cannot be read"):
        read_statistics(find_frame_sets(tmp_path)[0])
    write_image(broken, np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(MeasurementError, match="raw frames of one channel, got 3: demosaicing"):
        read_statistics(find_frame_sets(tmp_path)[0])
