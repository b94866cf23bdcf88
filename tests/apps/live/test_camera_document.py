"""Camera documents: the text that is saved is the camera that is shown, and drawn."""

import importlib
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from omnisim.apps.live.camera_document import (
    PRESETS_FILE,
    CameraDocument,
    found_cameras,
    preset_lists,
    with_preset,
)
from omnisim.apps.live.view_maker import profile
from omnisim.cameras import PerspectiveCamera, pixel_grid
from omnisim.cameras.catalog.lens_catalog import catalog
from omnisim.cameras.models.field_of_view import field_of_view
from omnisim.core.errors import CalibrationError, OutputError, SensorFileError
from omnisim.core.files.toml_file import toml_text
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.cameras.optics.examples import SYSTEMS

ROOT = Path(__file__).resolve().parents[3]
PRESETS = [(kind, name) for kind, names in preset_lists().items() for name in names]


@pytest.mark.parametrize(("kind", "name"), PRESETS)
def test_the_saved_text_of_a_preset_is_its_camera(tmp_path, kind, name):
    document = with_preset(CameraDocument(), kind, name)
    path = tmp_path / "camera.toml"
    path.write_text(document.text, encoding="utf-8")
    camera, saved = document.camera(), OmniCamera.from_file(path)
    assert saved.model.parameters() == camera.model.parameters()
    assert saved.degradation == camera.degradation
    assert saved.polygons == camera.polygons
    assert CameraDocument.of_sensor_file(path) == document


def test_presets_are_those_of_gallery_and_examples(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / ".ci"))
    gallery = importlib.import_module("make_gallery")
    assert PRESETS_FILE.read_text(encoding="utf-8") == gallery.presets(gallery.gallery_cameras())


def test_an_unknown_preset_names_the_nearest():
    with pytest.raises(OutputError, match="did you mean 'kannala_brandt'"):
        with_preset(CameraDocument(), "lens", "kanala_brandt")
    with pytest.raises(OutputError, match="preset 'lenses'"):
        with_preset(CameraDocument(), "lenses", "eucm")


def test_a_value_is_set_read_and_taken_away():
    document = CameraDocument().with_value("sensor.mirror.k", 8.0)
    assert document.value("sensor.mirror.k") == 8.0
    assert document.camera().model.mirror.k == 8.0
    assert document.with_value("sensor.mirror.k", None).camera().model.mirror.k == 11.546
    assert CameraDocument().value("sensor.mirror.k") is None


def test_what_is_saved_can_be_read_back(tmp_path):
    path = tmp_path / "camera.toml"
    path.write_text(CameraDocument().checked_text(), encoding="utf-8")
    assert "[mirror]" in path.read_text(encoding="utf-8")
    assert OmniCamera.from_file(path).model.parameters() == OmniCamera().model.parameters()
    refused = CameraDocument().with_value("sensor.mirror.k", 1.0)  # is not drawn yet
    with pytest.raises(SensorFileError, match=r"camera\.toml: mirror\.k: expected a number ≥ 2"):
        refused.checked_text()


def test_a_value_in_a_list_of_tables_is_set():
    document = with_preset(CameraDocument(), "optics", "sphere")
    changed = document.with_value("sensor.optics.surfaces.0.radius_m", 0.05)
    assert changed.value("sensor.optics.surfaces.0.radius_m") == 0.05
    assert document.value("sensor.optics.surfaces.0.radius_m") == 0.03


@pytest.mark.parametrize("path", ["", "mirror.k", "sensor", "sensor.mirror.k.x", "size_px.x"])
def test_an_impossible_path_is_refused(path):
    with pytest.raises(SensorFileError, match="expected a key"):
        CameraDocument().with_value("sensor.mirror.k", 3.0).with_value(path, 1.0)


@pytest.mark.parametrize("size", [2049, 15, 1.5, "big", True])
def test_an_impossible_size_is_refused(size):
    assert CameraDocument().with_value("size_px", 16).with_value("size_px", 2048).size_px == 2048
    with pytest.raises(SensorFileError, match="size_px: expected 16 to 2048 px"):
        CameraDocument().with_value("size_px", size)


def test_relative_files_become_absolute(tmp_path):
    (tmp_path / "profile.csv").write_text("r_m,z_m\n0,0\n0.01,0.002\n0.02,0.007\n0.03,0.015\n")
    optics = {
        "camera": {"model": "perspective", "width_px": 64, "height_px": 64,
                   "focal_length_px": 150.0},
        "surfaces": [{"shape": "table", "file": "profile.csv", "position_m": [0.0, 0.0, 0.1]}],
    }  # fmt: skip
    (tmp_path / "optics.toml").write_text(toml_text(optics))
    (tmp_path / "sensor.toml").write_text('[optics]\nfile = "optics.toml"\n')
    document = CameraDocument.of_sensor_file(tmp_path / "sensor.toml")
    assert document.value("sensor.optics.surfaces.0.file") == str(tmp_path / "profile.csv")
    pixels = pixel_grid(64, 64)
    expected = OmniCamera.from_file(tmp_path / "sensor.toml").model.ray_from_pixel(pixels)
    np.testing.assert_array_equal(
        document.camera().model.ray_from_pixel(pixels).directions, expected.directions
    )


def test_another_camera_keeps_mounting_quality_and_effects():
    document = CameraDocument(
        {
            "mirror": {"k": 8.0, "mounting": {"position_m": [0.1, 0.0, 0.5]}},
            "camera": {"width_px": 64, "quality": "fast"},
            "degradation": {"jpeg": {"quality": 50}},
        }
    )
    lens = with_preset(document, "lens", "equidistant")
    assert lens.value("sensor.lens.mounting.position_m") == [0.1, 0.0, 0.5]
    assert lens.value("sensor.camera") == {"quality": "fast"}
    assert lens.camera().degradation.jpeg.quality == 50
    assert lens.with_camera("mirror", {}).value("sensor.mirror") == {
        "mounting": {"position_m": [0.1, 0.0, 0.5]}
    }


NAME = "gopro/hero11-black/wide-3840x2160"


def test_a_camera_of_the_catalog_keeps_mounting_and_size_and_brings_its_readout():
    document = CameraDocument({"mirror": {"mounting": {"position_m": [0.1, 0.0, 0.5]}}}, 240)
    gopro = with_preset(document, "catalog", NAME)
    expected = OmniCamera.of_catalog(NAME).resized(240).model
    assert gopro.camera().model.parameters() == expected.parameters()
    assert gopro.value("sensor.lens.mounting") == {"position_m": [0.1, 0.0, 0.5]}
    measured = next(entry for entry in catalog().values() if entry.readout_s)
    bad_day = gopro.with_degradation("bad-day").camera().degradation.shutter
    rolling = with_preset(gopro.with_degradation("bad-day"), "catalog", measured.name)
    assert rolling.camera().degradation.shutter.readout_s == measured.readout_s
    assert rolling.camera().degradation.noise is not None
    unknown = with_preset(rolling, "catalog", NAME).camera().degradation.shutter
    assert (unknown.readout_s, unknown.exposure_s) == (0.0, bad_day.exposure_s)
    bare = with_preset(with_preset(gopro, "catalog", measured.name), "catalog", NAME)
    assert bare.camera().degradation.shutter is None
    with pytest.raises(CalibrationError, match="no such camera"):
        with_preset(document, "catalog", "gopro/none")


def test_a_sensor_file_with_a_camera_of_the_catalog_is_its_document(tmp_path):
    (tmp_path / "sensor.toml").write_text(f'[lens]\ncalibration = "catalog:{NAME}"\n')
    document = CameraDocument.of_sensor_file(tmp_path / "sensor.toml")
    assert document.camera().model == OmniCamera.of_catalog(NAME).model


def test_the_radius_is_drawn_as_far_as_the_image():
    lens = with_preset(CameraDocument(size_px=400), "catalog", NAME).camera().model
    angles_deg, radii_px = np.array(profile(lens)["points"]).T
    corner_px = 0.5 * np.hypot(lens.width_px, lens.height_px)  # from the image's center
    assert radii_px[-2] < corner_px + 10.0
    assert radii_px[-1] > corner_px - 10.0
    assert angles_deg[-1] < 80.0
    narrow = profile(PerspectiveCamera(64, 48, 5000.0, (32.0, 24.0)))["points"]
    assert [angle for angle, _ in narrow] == [0.0, 1.0]


def test_a_search_shows_sizes_and_angles_of_view():
    found = found_cameras("hero 11 black wide 4k")
    assert found["count"] == len(found["cameras"]) == 1
    camera = found["cameras"][0]
    assert (camera["name"], camera["title"]) == (NAME, "GoPro HERO11 Black Wide")
    seen = field_of_view(OmniCamera.of_catalog(NAME).model)
    wide, high = np.degrees((seen.horizontal_rad, seen.vertical_rad))
    assert camera["detail"] == f"3840 × 2160 px, {wide:.0f}° × {high:.0f}°"
    many = found_cameras("hero")
    assert many["count"] > 100 > len(many["cameras"])
    assert found_cameras(" ") == {"words": " ", "count": 0, "cameras": []}


def test_a_document_is_json_and_toml():
    document = with_preset(CameraDocument(), "degradation", "bad-day")
    assert json.loads(json.dumps(document.sensor)) == tomllib.loads(document.text)


def test_an_exposure_is_written_into_the_document():
    document = CameraDocument().with_degradation("webcam").with_exposure(-1.5)
    assert document.camera().degradation.exposure.ev == -1.5
    assert not document.camera().degradation.is_metered
    assert document.with_exposure("auto").camera().degradation.is_metered
    assert CameraDocument().with_exposure("auto").camera().degradation.is_metered


def test_a_port_without_a_rim_is_drawn_as_wide_as_its_rays():
    section = profile(SYSTEMS["port"])
    points_mm = np.array(section["rays"])  # (rays, 4, 2): the pinhole, both sides, and an end
    for side, curve in enumerate(section["curves"], start=1):
        low_mm, high_mm = np.array(curve["points"])[[0, -1]]
        seen_mm = points_mm[:, side]
        assert low_mm[0] < seen_mm[:, 0].min() < seen_mm[:, 0].max() < high_mm[0]
        np.testing.assert_allclose(seen_mm[:, 1], low_mm[1])
