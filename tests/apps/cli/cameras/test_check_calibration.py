"""`omnisim calibration check`: page, JSON, plots, exit status and errors."""

import json

import numpy as np
import pytest

from omnisim.cameras.calibration import Residuals, load_calibration
from omnisim.cameras.calibration.calibration_check import OtherFormats
from omnisim.core.files.image_files import read_image, write_image
from tests.cameras.calibration.sample_files import FOLDER

CHECK = ("calibration", "check")
TUM_VI = FOLDER / "kalibr_tum_vi.yaml"


def test_the_page_has_findings_formats_and_the_rig(quiet):
    out = quiet(*CHECK, TUM_VI)
    assert "kalibr, 2 cameras, from Kalibr" in out
    assert "cam1: kannala_brandt, 512 × 512 px" in out
    assert "ok       principal point  (-0.57, 1.4) px from the middle, 0.3 % of the image" in out
    assert "colmap: COLMAP's own projection ends at 90°" in out
    assert "ok       cam0 – cam1  101.1 mm and 2.7° apart, 94 % of the view shared" in out
    assert out.rstrip().endswith("15 ok, 0 unusual, 0 wrong")


def test_notes_are_findings(ran):
    out, err = ran(*CHECK, FOLDER / "kitti360_image_02.yaml")
    assert err == ""
    assert "ends at 116.9°, inside the image: 13 % of it is black" in out


def test_json_has_the_same(quiet):
    content = json.loads(quiet(*CHECK, TUM_VI, "--json", "--camera-name", "cam0"))
    assert content["tool"] == "Kalibr"
    assert list(content["cameras"]) == ["cam0"]
    camera = content["cameras"]["cam0"]
    assert camera["findings"][0]["subject"] == "field of view"
    exact = [name for each in camera["formats"] if each["is_exact"] for name in each["formats"]]
    assert {"kalibr", "colmap", "basalt"} <= set(exact)
    assert content["plots"] == content["rig"] == []


def test_a_wrong_rig_ends_with_1(omnisim, tmp_path):
    """cam1 is 0.1 m from cam0 by their chain, and 0.15 m by the IMU."""
    lens = """
  camera_model: pinhole
  intrinsics: [300.0, 300.0, 319.5, 239.5]
  distortion_model: none
  resolution: [640, 480]
"""
    pose = "[[1.0, 0.0, 0.0, {}], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]"
    text = f"cam0:{lens}  T_cam_imu: {pose.format('0.0')}\ncam1:{lens}"
    text += f"  T_cn_cnm1: {pose.format('-0.1')}\n  T_cam_imu: {pose.format('-0.15')}\n"
    (tmp_path / "c.yaml").write_text(text)
    status, out, err = omnisim(*CHECK, "c.yaml")
    assert (status, err) == (1, "")
    (line,) = (line for line in out.splitlines() if line.startswith("wrong"))
    assert "50 mm" in line
    (tmp_path / "c.yaml").write_text(text.replace("-0.15", "-0.1"))
    status, out, _ = omnisim(*CHECK, "c.yaml")
    assert (status, "100 mm and 0.0° apart" in out) == (0, True)


def test_plots_show_formats_and_straight_lines(ran, tmp_path):
    pytest.importorskip("matplotlib")
    photo = np.full((512, 512, 3), 90, np.uint8)
    write_image(tmp_path / "photo.png", photo)
    words = TUM_VI, "photo.png", "--camera-name", "cam0", "-o", "out"
    out, _ = ran(*CHECK, *words)
    assert "out/check.png: plot" in out
    assert "out/photo-lines.png: plot" in out
    pixels = read_image(tmp_path / "out" / "photo-lines.png")[0][..., :3].astype(int)
    is_line = (pixels[..., 2] > 150) & (pixels[..., 0] < 90)  # blue
    is_photo = (pixels == 90).all(axis=-1)
    assert 0.01 < is_line.mean() < 0.1
    assert is_photo.mean() > 0.5
    # left: lines bend; right: they are whole rows and columns of the view
    right = is_line[:, is_line.shape[1] // 2 :]
    assert (right.mean(axis=0) > 0.6).sum() >= 5
    assert not (is_line[:, : is_line.shape[1] // 2].mean(axis=0) > 0.6).sum() >= 5


def test_each_fit_has_its_color():
    pytest.importorskip("matplotlib")
    from omnisim.plots.calibration_plot import check_figure

    lens = load_calibration(FOLDER / "opencv_pinhole.yaml").cameras[0].camera.scaled(0.1)
    fits = [
        OtherFormats([name], lens.scaled(1.0), "eucm", Residuals(0.1, size_px, 1.0, "unified"))
        for name, size_px in (("a", 0.2), ("b", 0.3))
    ]
    (_, difference) = check_figure({"cam0": (lens, [], fits)}).axes
    colors = [line.get_color() for line in difference.get_lines()[1:]]
    assert len(set(colors)) == 2


@pytest.mark.parametrize(
    ("shape", "kind"),
    [((48, 64, 1), np.uint8), ((48, 64, 3), np.uint16), ((48, 64, 4), np.float32)],
)
def test_lines_are_drawn_on_any_photo(shape, kind):
    pytest.importorskip("matplotlib")
    from omnisim.plots.calibration_plot import lines_figure

    camera = load_calibration(FOLDER / "opencv_pinhole.yaml").cameras[0].camera.scaled(0.1)
    level = 0.5 if kind is np.float32 else np.iinfo(kind).max // 2
    figure = lines_figure("photo", np.full(shape, level, kind), camera)
    for axes in figure.axes:
        (image,) = axes.get_images()
        shown = np.asarray(image.get_array())
        assert (shown.shape, shown.dtype) == ((48, 64, 3), np.uint8)
        assert shown.max() == (127 if kind is not np.float32 else 188)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((TUM_VI, "photo.png"), "-o: missing: expected a folder for the plot of photo.png"),
        ((TUM_VI, "photo.png", "-o", "out"),
         "--camera-name: missing: expected one of cam0, cam1, which took photo.png"),
        ((TUM_VI, "photo.png", "-o", "out", "--camera-name", "cam0"),
         "photo.png: 20 × 10 px: expected 512 × 512 px as in"),
        ((TUM_VI, "photo.png", "sub/photo.png", "-o", "out", "--camera-name", "cam0"),
         "out/photo-lines.png: is the plot of photo.png already"),
        (("none.yaml",), "none.yaml: cannot be read"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_one_line(refused, tmp_path, words, message):
    write_image(tmp_path / "photo.png", np.zeros((10, 20, 3), np.uint8))
    assert message in refused(*CHECK, *words)
