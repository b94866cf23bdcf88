"""`[degradation]` in sensor files, presets, and every fault in one line."""

import dataclasses
import re

import pytest

from omnisim.core.errors import OpticsError, SensorFileError
from omnisim.core.files.sources import fingerprint
from omnisim.rendering.camera.degradations import (
    Bayer,
    Degradation,
    Noise,
    Shutter,
    WhiteBalance,
    preset,
    preset_names,
)
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS
from omnisim.rendering.camera.omnicamera import OmniCamera


def _read(tmp_path, text):
    (tmp_path / "sensor.toml").write_text(text)
    return OmniCamera.from_file(tmp_path / "sensor.toml").degradation


def test_ideal_is_the_default(tmp_path):
    assert OmniCamera().degradation.is_ideal
    assert _read(tmp_path, "[degradation]\npreset = 'ideal'").is_ideal
    assert "degradation" not in OmniCamera().to_toml()


def test_preset_names():
    assert preset_names() == ["bad-day", "dragonfly2", "ideal", "webcam"]
    assert preset("ideal") == Degradation()
    assert preset("bad-day").parts.keys() >= {"noise", "dirt", "shutter", "jpeg"}
    assert preset("dragonfly2").shutter.readout_s == 0.0  # a CCD


def test_tables_override_a_preset_key_by_key(tmp_path):
    text = (
        "[degradation]\npreset = 'webcam'\n[degradation.noise]\nread_noise_e = 20\n"
        "[degradation.jpeg]\nenabled = false\n[degradation.reflectance]\n"
    )
    got, webcam = _read(tmp_path, text), preset("webcam")
    assert got.noise == dataclasses.replace(webcam.noise, read_noise_e=20.0)
    assert got.jpeg is None
    assert got.reflectance.reflectance == 0.9
    assert got.bayer == webcam.bayer


def test_preset_file_beside_the_sensor_file(tmp_path):
    (tmp_path / "mine.toml").write_text("[bayer]\npattern = 'GBRG'\n")
    assert _read(tmp_path, "[degradation]\npreset = 'mine.toml'").bayer == Bayer("GBRG")
    assert preset("mine.toml", tmp_path) == Degradation(bayer=Bayer("GBRG"))


@pytest.mark.parametrize("name", [*preset_names(), "all defaults"])
def test_sensor_file_round_trip(tmp_path, name):
    if name == "all defaults":
        parts = {key: kind() for key, kind in EFFECTS.items()}
        degradation = Degradation(**parts)
    else:
        degradation = preset(name)
    sensor = OmniCamera().with_degradation(degradation).resized(100)
    text = sensor.to_toml()
    assert _read(tmp_path, text) == sensor.degradation
    assert OmniCamera.from_file(tmp_path / "sensor.toml").to_toml() == text


def test_fingerprint_and_size_depend_on_degradation():
    one = OmniCamera().with_degradation(preset("webcam"))
    prints = {fingerprint(OmniCamera()), fingerprint(one)}
    noise = dataclasses.replace(one.degradation.noise, read_noise_e=4.5)
    prints.add(fingerprint(one.with_degradation(dataclasses.replace(one.degradation, noise=noise))))
    assert len(prints) == 3
    doubled = one.resized(720).degradation
    assert doubled.defocus.rim_defocus_px == 2.0 * one.degradation.defocus.rim_defocus_px
    assert doubled.noise == one.degradation.noise


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("preset = 'dragonfly'", "preset = 'dragonfly': .* did you mean 'dragonf"),
        ("preset = 'nikon'", "unknown preset; expected one of bad-day, dragonfly2, id"),
        ("preset = 'no.toml'", r"no\.toml: cannot be read: No such file"),
        ("preset = 3", "preset: expected text.*, got 3"),
        ("noise = 3", "noise: expected a table.*, got 3"),
        ("nois = {}", "nois: unknown key; did you mean 'noise'"),
        ("noise.read_noise_e = -1", r"noise\.read_noise_e: expected a number ≥ 0.*, got -1"),
        ("noise.read_noise_e = nan", "read_noise_e: expected a finite number.*, got nan"),
        ("noise.read_noise = 3", "read_noise: unknown key; did you mean 'read_nois"),
        ("noise.bit_depth = 17", "bit_depth: expected a number ≤ 16.*, got 17"),
        (
            "noise.bit_depth = 4\nnoise.black_level_dn = 15",
            "dn: expected less than 15, .* of 4 bits, got 15",
        ),
        ("noise.dark_current_e_per_s = 5", r"_s = 5: needs degradation\.shutter\.exposure_s"),
        ("noise.pattern = 'none.exr'", r"noise\.pattern = 'none\.exr': no such file beside it"),
        ("noise.pattern = ''", r"noise\.pattern: expected "),
        ("noise.prnu = 1.5", r"noise\.prnu: expected a number ≤ 1, got 1\.5"),
        ("shutter.exposure_s = 0", "exposure_s: expected a number > 0, got 0"),
        ("shutter.exposure_s = -0.1", r"exposure_s: expected a number > 0, got -0\.1"),
        ("shutter.exposure_s = '5 ms'", "exposure_s: expected a number.*, got '5 ms'"),
        ("shutter.exposure_ms = 5", "exposure_ms: unknown key; did you mean 'expos"),
        (
            "shutter.exposure_s = 0.05\nshutter.frame_rate_hz = 30",
            r"r\.exposure_s: expected at most 0\.03.* got 0\.05",
        ),
        (
            "shutter.readout_s = 0.05\nshutter.frame_rate_hz = 30",
            r"readout_s: expected at most 0\.03.*, got 0\.05",
        ),
        ("shutter.sub_frames = 0", "sub_frames: expected .* or 'auto'.*, got 0"),
        ("exposure.min_ev = 3\nexposure.max_ev = 2", "min_ev: expected at most max_ev = 2, got 3"),
        ("exposure.ev = 99", r"exposure\.ev: expected a number ≤ 30.*, got 99"),
        ("exposure.auto = true\nexposure.max_ev = 3000", "max_ev: expected.*, got 3000"),
        ("noise.read_noise_e = 1e300", r"read_noise_e: expected.*, got 1e\+300"),
        ("noise.gain_e_per_dn = 1e-300", "per_dn: expected.*, got 1e-300"),
        ("reflectance.tint = [1e300, 1, 1]", r"tint\.0: expected a number.*, got 1e\+300"),
        (
            "vignetting.coefficients = [0, -1e300, 0]",
            r"s\.1: expected a number ≥ -1.*, got -1e\+300",
        ),
        ("white_balance.response = [1, 1e-300, 1]", r"response\.1: expected.*, got 1e-300"),
        ("bayer.pattern = 'RGBG'", "pattern: expected 'RGGB', 'BGGR'.*, got 'RGBG'"),
        ("jpeg.quality = 0", "quality: expected a number ≥ 1.*, got 0"),
        ("defocus.rim_defocus_px = 50", "rim_defocus_px: expected.*, got 50"),
        ("reflectance.reflectance = 0", "reflectance: expected a number > 0.*, got 0"),
        ("chromatic_aberration.red_scale = 2", "red_scale: expected.*, got 2"),
        ("encoding.gamma = 'log'", "gamma: expected a number .* or 'srgb'.*, got 'log'"),
        ("white_balance.response = [1, 0, 1]", r"response\.1: expected a number.*, got 0"),
    ],
)
def test_every_fault_names_file_key_and_value(tmp_path, text, words):
    with pytest.raises(SensorFileError, match=words) as info:
        _read(tmp_path, f"[degradation]\n{text}")
    assert re.match(r"\S+\.toml: ", str(info.value))
    assert "\n" not in str(info.value)


def test_constructors_check_like_files():
    with pytest.raises(
        OpticsError, match=r"degradation\.noise\.read_noise_e: expected.*, got -1\.0"
    ):
        Noise(read_noise_e=-1.0)
    with pytest.raises(OpticsError, match=r"exposure_s: expected at most 0\.1 s.*, got 1"):
        Shutter(exposure_s=1.0, frame_rate_hz=10.0)
    with pytest.raises(OpticsError, match=r"degradation\.white_balance\.gains: expected"):
        WhiteBalance(gains="red")


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_has_the_name_of_its_module_and_table(name):
    kind = EFFECTS[name]
    assert kind._name == f"degradation.{name}"
    assert kind.__module__.rpartition(".")[2] == name


def test_a_preset_file_has_keys_without_the_prefix_of_a_sensor_file(tmp_path):
    file = tmp_path / "mine.toml"
    for text, words in (
        ("noise.dark_current_e_per_s = 5", "noise.dark_current_e_per_s = 5: needs shutter.expos"),
        ("shutter.exposure_ms = 5", "shutter.exposure_ms: unknown key"),
    ):
        file.write_text(text)
        with pytest.raises(SensorFileError) as info:
            preset(str(file))
        assert str(info.value).startswith(f"{file}: {words}")
