"""`omnisim calibration` and `omnisim render --camera`: output, files and errors."""

import math
import os
import re
from pathlib import Path

import numpy as np
import pytest

from omnisim.cameras import MirroredCamera
from omnisim.cameras.calibration import calibration_of, load_calibration
from omnisim.core.errors import SensorFileError
from omnisim.core.files.image_files import read_image, write_image
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.camera_examples import CAMERA_EXAMPLES
from tests.cameras.calibration.sample_files import FOLDER

KITTI = FOLDER / "kitti360_image_02.yaml"
TUM_VI = FOLDER / "kalibr_tum_vi.yaml"
SPHERE = Path(__file__).parents[4] / "examples" / "optics" / "sphere.toml"
PAPER = CAMERA_EXAMPLES["hyperbolic-paper"]
CONVERT, SHOW = ("calibration", "convert"), ("calibration", "show")


def test_convert_prints_a_summary(ran, tmp_path):
    out, err = ran(*CONVERT, TUM_VI, "--to", "colmap", "-o", "c.txt")
    assert "c.txt: COLMAP: cameras.txt" in out
    assert "1 (was cam0): kannala_brandt, with identical rays" in out
    assert "note: 1: sees up to 115.6° from its axis: COLMAP's own projection ends at 90°" in err
    assert "2 (was cam1): kannala_brandt, with identical rays" in out
    assert load_calibration(tmp_path / "c.txt").names == ["1", "2"]


def test_convert_selects_one_camera_with_a_note(ran, tmp_path):
    arguments = (*CONVERT, TUM_VI, "--to", "opencv_fisheye", "-o", "f.yaml")
    _, err = ran(*arguments)
    assert "the first of 2 cameras, cam0, is used; --camera-name selects another of cam0," in err
    out, err = ran(*arguments, "--camera-name", "cam1")
    assert "the first" not in err
    assert "cv2.fisheye's own projection is wrong past 90°" in err
    assert "camera (was cam1): kannala_brandt, with identical rays" in out
    camera = load_calibration(tmp_path / "f.yaml").cameras[0].camera
    assert camera.focal_lengths_px == (190.44236969414825, 190.4344384721956)


def test_convert_states_the_residual(ran, tmp_path):
    words = "--to", "kalibr", "--model", "eucm", "--camera-name", "cam0", "-o", "e.yaml"
    out, _ = ran(*CONVERT, TUM_VI, *words)
    residual = load_calibration(tmp_path / "e.yaml").cameras[0].residuals
    assert f"eucm, fitted to kannala_brandt: RMS {residual.rms_px:.3g} px" in out
    assert f"at most {residual.max_px:.3g} px" in out


def test_a_sensor_file_is_a_calibration(ran, refused, tmp_path):
    (tmp_path / "s.toml").write_text(OmniCamera(PAPER).to_toml())
    out, _ = ran(*CONVERT, "s.toml", "--to", "opencv_omnidir", "-o", "o.yaml")
    assert "camera: unified in a mirrored frame, with identical rays" in out
    assert "xi: 0.99549" in (tmp_path / "o.yaml").read_text()
    line = refused(*SHOW, "s.toml", "--camera-name", "x")
    assert "expected a calibration file, got s.toml" in line


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (KITTI, ["kitti360, 1 camera", "image_02", "unified", "1400 × 1400 px", "2.213404751",
                 "field of view    198.2° × 197.9°", "116.86°", "86.8 %"]),
        (TUM_VI, ["kalibr, 2 cameras, from Kalibr", "cam0_from_imu", "512 × 512 px", "100.0 %"]),
        (FOLDER / "transforms.json", ["world_from_images/frame_00002.jpeg"]),
        (FOLDER / "ocamcalib.txt", ["model's limit"]),
    ],
)  # fmt: skip
def test_show_lists_the_view_of_a_camera(ran, name, message):
    out, err = ran(*SHOW, name)
    black = "the lens ends at 116.9°, inside the image: 13 % of the image is black"
    assert err == (f"note: {name}: {black}\n" if name == KITTI else "")
    assert [line for line in message if line not in out] == []
    assert "theta max" not in out


def test_show_of_a_mirror(ran, tmp_path):
    calibration_of(CAMERA_EXAMPLES["parabolic"]).save(tmp_path / "m.yaml", "kalibr")
    assert "from −z, as it looks into a mirror" in ran(*SHOW, "m.yaml")[0]
    assert "mirror" not in ran(*SHOW, "m.yaml", "--not-mirrored")[0]


def test_the_formats_are_listed(quiet):
    out = quiet("calibration", "formats")
    assert all(word in out for word in ("camchain.yaml", "woodscape", "double_sphere", "*.sdf"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*CONVERT, TUM_VI, "--to", "kalibr", "-o", "o.png"],
         "o.png: expected .yaml or .yml for kalibr, got .png"),
        ([*CONVERT, TUM_VI, "--to", "kalbr", "-o", "x"],
         "format 'kalbr': did you mean 'kalibr'?"),
        ([*CONVERT, TUM_VI, "--to", "ros", "-o", "x"], "cam0: sees up to 115.6° from its axis"),
        ([*CONVERT, KITTI, "--to", "gazebo", "-o", "x"], "image_02: gazebo cannot represent"),
        ([*CONVERT, TUM_VI, "--to", "ros", "-o", "x", "--camera-name", "c"],
         "expected one of cam0, cam1, got 'c'"),
        ([*CONVERT, TUM_VI, "--to", "colmap", "-o", "x", "--model", "gazebo"], "colmap has"),
        ([*SHOW, TUM_VI, "--format", "colmap"], "looks like a kalibr file"),
        ([*SHOW, "foreign.png"], "foreign.png: expected an image by omnisim"),
        ([*CONVERT, TUM_VI, "--to", "colmap", "-o", "pipe"], "pipe: is not a regular file"),
        (["render", "rings", "-o", "x.png", "--camera", KITTI, "-n", "16"],
         "has no mirror with a mesh"),
        (["render", "rings", "-o", "x.png", "--camera", TUM_VI, "--camera-name", "cam7"],
         "expected one of cam0, cam1, got 'cam7'"),
        (["render", "rings", "-o", "x.png", "--mirrored"], "--mirrored: requires --camera"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_one_error(omnisim, tmp_path, arguments, message):
    os.mkfifo(tmp_path / "pipe")
    write_image(tmp_path / "foreign.png", np.zeros((2, 2, 3), np.uint8))
    status, _, err = omnisim(*arguments)
    assert (status, err.count("error:")) == (1, 1)
    assert message in err.splitlines()[-1]
    assert not list(tmp_path.glob("x*"))


@pytest.mark.usefixtures("needs_opengl")
def test_published_calibrations_render(ran, tmp_path):
    out, _ = ran("render", "rings", "--camera", KITTI, "--size", 70, "-o", "k.png")
    assert "k.png: 70 × 70 px, exact" in out
    pixels, metadata = read_image(tmp_path / "k.png")
    assert metadata["camera"]["model"] == "unified"
    assert metadata["camera"]["xi"] == 2.2134047507854890
    assert pixels[35, 35].any()
    assert not pixels[0, 0, :3].any()  # past the rim
    words = "--camera-name", "cam1", "--size", 64, "-o", "t.png"
    assert ran("render", "rings", "--camera", TUM_VI, *words)[1] == ""
    # what was rendered says its calibration, and becomes a file again
    out, _ = ran(*CONVERT, "t.png", "--to", "kalibr", "-o", "t.yaml")
    assert "cam0 (was camera): kannala_brandt, with identical rays" in out


@pytest.mark.usefixtures("needs_opengl")
def test_a_mirror_from_a_file_renders_the_same_image(ran, tmp_path):
    calibration_of(PAPER).save(tmp_path / "m.yaml", "kalibr")
    calibration_of(PAPER).save(tmp_path / "kb.yaml", "kalibr", model="kannala_brandt")

    def image(*camera):
        ran("render", "compass", "--size", 80, *camera, "-o", "a.png")
        return read_image(tmp_path / "a.png")[0].astype(float)

    ours, by_file = image("-n", "exact"), image("--camera", "m.yaml")
    by_lens = image("--camera", "kb.yaml")
    assert np.abs(ours - by_file).max() <= 1.0  # a color's rounding
    # of a lens that is fitted to it the edges are others by a little; mirrored, all would be
    mirrored = np.mean(np.abs(ours - ours[:, ::-1]))
    assert np.mean(np.abs(ours - by_lens)) < 0.1 * mirrored


def test_a_sensor_file_may_refer_to_a_calibration(tmp_path):
    (tmp_path / "camchain.yaml").write_text(TUM_VI.read_text())
    text = (
        '[lens]\ncalibration = "camchain.yaml"\ncamera = "cam1"\n[lens.mounting]\npitch_deg = 5.0\n'
    )
    (tmp_path / "s.toml").write_text(text)
    sensor = OmniCamera.from_file(tmp_path / "s.toml")
    assert sensor.model == load_calibration(TUM_VI).cameras[1].camera
    assert sensor.polygons is None
    looks_up = text.replace("[lens.mounting]", "mirrored = true\n[lens.mounting]")
    (tmp_path / "up.toml").write_text(looks_up)
    assert OmniCamera.from_file(tmp_path / "up.toml").model == MirroredCamera(sensor.model)
    # a drive's own copy stands for itself
    (tmp_path / "copy.toml").write_text(sensor.to_toml())
    assert OmniCamera.from_file(tmp_path / "copy.toml").model == sensor.model


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_sensor_file_ends_the_field_of_a_calibration(tmp_path, mirrored):
    (tmp_path / "c.yaml").write_text(TUM_VI.read_text())
    text = f'[lens]\ncalibration = "c.yaml"\nmirrored = {str(mirrored).lower()}\n'
    (tmp_path / "s.toml").write_text(text + "theta_max_deg = 80\n")
    model = OmniCamera.from_file(tmp_path / "s.toml").model
    lens = load_calibration(TUM_VI).cameras[0].camera.ending_at(math.radians(80.0))
    assert model == (MirroredCamera(lens) if mirrored else lens)


@pytest.mark.parametrize(
    ("theta_max_deg", "note"),
    [
        (100, "s.toml: lens: θ_max = 100.0° is never reached: the lens folds at 74.0°"),
        (180, "s.toml: lens: the lens folds at 74.0°, inside the image: "),
        (1.658, "lens.theta_max_deg = 1.658: a field of view of 3.316°; 1.658 rad would be 95.0°"),
    ],
)
def test_notes_on_the_field_of_a_sensor_file(ran, tmp_path, theta_max_deg, note):
    (tmp_path / "s.toml").write_text(
        '[lens]\nmodel = "kannala_brandt"\nwidth_px = 320\nheight_px = 240\n'
        "focal_lengths_px = [90.0, 90.0]\nprincipal_point_px = [159.5, 119.5]\n"
        f"coefficients = [-0.2, 0.0, 0.0, 0.0]\ntheta_max_deg = {theta_max_deg}\n"
    )
    _, err = ran("sensor", "--check", "s.toml")
    assert err.startswith("note: ")
    assert note in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('calibration = "none.yaml"', r"s\.toml: lens\.calibration: .*none\.yaml: cannot be read"),
        ('calibration = "c.yaml"\ncamera = "left"', "expected one of cam0, cam1, got 'left'"),
        ('calibration = "c.yaml"\nxi = 1.0', r"lens\.xi: expected none with calibration"),
        ('calibration = "c.yaml"\nmodel = "eucm"', r"lens\.model: expected none with calib"),
        ('calibration = "c.yaml"\ntheta_max_de = 95', "theta_max_de: unknown key with calib"),
        ('calibration = "c.yaml"\ntheta_max_deg = "a"', "theta_max_deg: expected a number, 0"),
        ('calibration = "ds.json"\ntheta_max_deg = 95', "double_sphere has a limit of its own"),
        ('model = "kanala_brandt"', "lens.model: expected .*: did you mean 'kannala_brandt'"),
        ('model = "perspective"\nwidth_px = 320\nheigth_px = 240',
         "lens.heigth_px: unknown key; did you mean 'height_px'"),
        ('model = "eucm"\ncamera = "cam0"', r"lens\.camera: is a name in a calibration file"),
        ("", r"lens.model: missing; expected it, or calibration"),
    ],
)  # fmt: skip
def test_sensor_files_that_name_no_calibration(tmp_path, text, message):
    (tmp_path / "c.yaml").write_text(TUM_VI.read_text())
    (tmp_path / "ds.json").write_text((FOLDER / "basalt_tum_vi_ds.json").read_text())
    (tmp_path / "s.toml").write_text(f"[lens]\n{text}\n")
    with pytest.raises(SensorFileError, match=message) as info:
        OmniCamera.from_file(tmp_path / "s.toml")
    assert "\n" not in str(info.value)


def test_optics_are_fitted_and_the_rest_is_told(ran, refused, tmp_path):
    text = SPHERE.read_text().replace("= 360", "= 72").replace("= 1000.0", "= 200.0")
    (tmp_path / "optics.toml").write_text(text)
    (tmp_path / "sensor.toml").write_text('[optics]\nfile = "optics.toml"\n')
    metadata = {"camera": OmniCamera.from_file(tmp_path / "sensor.toml").model.parameters()}
    write_image(tmp_path / "taken.png", np.zeros((72, 72, 3), dtype=np.uint8), metadata)
    fitted = set()
    for given in (("--optics", "optics.toml"), ("taken.png",)):
        words = "--to", "opencv_fisheye", "-o", "a.yaml", "--at-distance", 0.5, 2
        out, err = ran(*CONVERT, *given, *words)
        assert re.fullmatch(
            r"note: camera: sees up to 15\d\.\d° from its axis: cv2.fisheye's .*\n", err
        )
        assert "kannala_brandt in a mirrored frame, fitted to optics: RMS" in out
        assert "viewpoint (0.00000, " in out
        assert [line.split()[0] for line in out.splitlines()[-3:]] == ["infinity", "0.5", "2"]
        fitted.add(out)
    assert len(fitted) == 1
    shown, _ = ran(*SHOW, "a.yaml")
    assert "optics_from_camera" in shown
    assert "points at 0.5 m" in shown
    words = "expected a central camera, got optics: `omnisim calibration convert` fits one"
    assert f"sensor.toml: {words}" in refused(*SHOW, "sensor.toml")
