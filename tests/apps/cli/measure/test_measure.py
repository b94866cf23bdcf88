"""`omnisim measure`: output, files and errors."""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import omnisim as package
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.omnicamera import OmniCamera

FRAMES = Path(package.__file__).parents[1] / "examples" / "noise_frames.py"


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """Folder of frames, as in the documentation."""
    folder = tmp_path_factory.mktemp("frames")
    subprocess.run([sys.executable, FRAMES, folder], check=True)
    return folder


@pytest.mark.slow
@pytest.mark.long
def test_noise(quiet, frames, tmp_path):
    out = quiet("measure", "noise", frames / "dark", frames / "flat", "-o", "camera.toml")
    assert "camera.toml: written" in out
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"camera-pattern.exr", "camera.json", "camera.toml"}
    text = (tmp_path / "camera.toml").read_text()
    assert text.startswith("# noise: gain_e_per_dn = 3.")
    noise = OmniCamera.from_file(tmp_path / "camera.toml").degradation.noise
    assert noise.gain_e_per_dn == pytest.approx(3.1, rel=0.01)
    assert noise.pattern == str(tmp_path / "camera-pattern.exr")
    report = json.loads((tmp_path / "camera.json").read_text())["noise"]
    values = {quantity["name"]: quantity["value"] for quantity in report["quantities"]}
    assert values["prnu"] == pytest.approx(0.011, rel=0.05)
    assert report["not_measured"] == []
    assert len(report["photon_transfer"]["mean_dn"]) == 12


@pytest.fixture
def small_frames(monkeypatch, tmp_path):
    """Frames of the documentation's camera with a sixteenth of its pixels."""
    example = runpy.run_path(str(FRAMES))
    monkeypatch.setitem(
        example["raw_frame"].__globals__, "GEOMETRY", ImageGeometry(80, 60, (39.5, 29.5))
    )
    example["main"](tmp_path / "frames")
    return tmp_path / "frames"


def test_noise_is_added_to_a_sensor_file(ran, small_frames, tmp_path):
    dark, flat = small_frames / "dark", small_frames / "flat"
    (tmp_path / "lens").mkdir()
    lens = tmp_path / "lens" / "lens.toml"
    lens.write_text("[degradation]\npreset = 'webcam'\n[mirror]\nk = 12.0\n")
    ran("measure", "noise", dark, flat, "--sensor", lens, "-o", "camera.toml")
    camera, before = (OmniCamera.from_file(path) for path in (tmp_path / "camera.toml", lens))
    assert camera.model == before.model
    assert camera.degradation.jpeg == before.degradation.jpeg
    assert camera.degradation.shutter == before.degradation.shutter
    assert camera.degradation.noise.bit_depth == 12


def test_bad_input(refused, tmp_path):
    (tmp_path / "dark" / "1ms").mkdir(parents=True)
    (tmp_path / "dark" / "1ms" / "0.jpg").write_bytes(b"")
    for arguments, expected in (
        (("dark", "flat", "-o", "c.json"), "c.json: expected a name that ends in .toml"),
        (("dark", "flat", "-o", "c.toml"), "dark/1ms/0.jpg: lossy compression changes the noise"),
        (("dark", "flat", "-o", "c.toml", "--sensor", "s.toml"), "s.toml: cannot be read"),
    ):
        assert refused("measure", "noise", *arguments).startswith(expected)
