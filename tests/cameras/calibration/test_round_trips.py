"""A camera written to a file and read back sees the same rays, wherever a format has its model."""

import numpy as np
import pytest

from omnisim.cameras import (
    CAMERA_MODELS,
    KannalaBrandtCamera,
    MirroredCamera,
    ThinPrismFisheyeCamera,
)
from omnisim.cameras.calibration import (
    FORMATS,
    calibration_of,
    calibration_text,
    encode,
    load_calibration,
)
from omnisim.core.errors import CalibrationError
from tests.camera_examples import CAMERA_EXAMPLES
from tests.cameras.calibration.sample_files import EXACT_SAMPLES, rig_rays
from tests.slow import slow_but

UNIFIED = {"hyperbolic", "elliptic", "parabolic", "planar", "perspective", "stereographic"}
FISHEYES = {"equidistant", "kannala_brandt", "f_theta"}
CAMERA_INFO = {
    "perspective", "planar", "unified", "hyperbolic", "kannala_brandt", "rational_polynomial",
}  # fmt: skip
SOLVED = {"perspective", "planar", "unified", "hyperbolic", "equirectangular"} | FISHEYES
SPHERES = {"unified", "eucm", "double_sphere"}
EXAMPLES = {
    **CAMERA_EXAMPLES,
    "kannala-brandt-below-90°": KannalaBrandtCamera(
        320, 240, (150.0, 151.0), (160.25, 118.5), (-0.012, 0.021, -0.015, 0.0035)
    ),
    "thin-prism-fisheye-below-90°-without-prism": ThinPrismFisheyeCamera(
        320,
        240,
        (150.0, 151.0),
        (160.25, 118.5),
        (-0.012, 0.021, -0.015, 0.0035, 1e-3, -2e-4),
        (1e-3, -5e-4),
    ),
}
# Models of which some example is exact, by format.
EXACT = {
    "omnisim": set(CAMERA_MODELS),
    "kalibr": UNIFIED | FISHEYES | SPHERES,
    "euroc": UNIFIED | FISHEYES | SPHERES,
    "kitti360": UNIFIED | FISHEYES | {"unified"},
    "orbslam3": {"perspective", "planar", "unified", "hyperbolic"} | FISHEYES,
    "opencv_omnidir": UNIFIED | {"unified"},
    "opencv_fisheye": FISHEYES,
    "opencv_pinhole": {"perspective", "planar", "unified", "hyperbolic", "rational_polynomial"},
    "ros": CAMERA_INFO,
    "foxglove": CAMERA_INFO | {"thin_prism_fisheye"},
    "basalt": UNIFIED | FISHEYES | SPHERES | {"rational_polynomial"},
    "woodscape": FISHEYES,
    "gyroflow": FISHEYES,
    "nerfstudio": {"perspective", "planar", "unified", "hyperbolic", "equirectangular"} | FISHEYES,
    "ocamcalib": {"perspective", "planar", "hyperbolic", "stereographic", "parabolic", "ocamcalib"},
    "colmap": UNIFIED | FISHEYES | {"unified", "eucm", "equirectangular", "rational_polynomial"}
    | {"thin_prism_fisheye", "division"},
    "isaac": {"perspective", "planar", "hyperbolic", "unified", "rational_polynomial",
              "f_theta_inverse"} | FISHEYES,
    "nurec": {"equidistant", "kannala_brandt", "f_theta", "f_theta_inverse"},
    "blender_osl": set(CAMERA_MODELS) - {"cylindrical", "equirectangular"},
    "opensfm": SOLVED | {"thin_prism_fisheye"},
    "openmvg": SOLVED - {"unified"},  # the examples have two focal lengths
    "metashape": SOLVED | {"equisolid"},
    "aria": FISHEYES | {"thin_prism_fisheye"},
    "insta360": UNIFIED | {"unified"},
    "matlab": {
        "perspective", "planar", "hyperbolic", "stereographic", "parabolic", "ocamcalib", "unified",
    },
    "gazebo": {
        "perspective", "planar", "hyperbolic", "stereographic", "parabolic", "equidistant",
        "equisolid", "orthographic", "gazebo",
    },
}  # fmt: skip


@pytest.fixture
def no_fits(monkeypatch):
    def refuse(*arguments, **keywords):
        raise CalibrationError("camera: not exactly")

    monkeypatch.setattr(encode, "fit_camera", refuse)


@pytest.mark.usefixtures("no_fits")
@pytest.mark.parametrize(
    "form", slow_but(FORMATS, *(FORMATS.keys() - {"blender_osl"}), long=["blender_osl"])
)
def test_exact_models_come_back(form, tmp_path):
    path = tmp_path / f"file{FORMATS[form].suffix}"
    exact = set()
    for name, camera in EXAMPLES.items():
        try:
            text, written = calibration_text(calibration_of(camera), form)
        except CalibrationError:
            continue
        exact.add(camera.model_name)
        path.write_text(text)
        loaded = load_calibration(path)
        assert loaded.format == form, name
        found = loaded.cameras[0]
        assert found.residuals is None
        assert type(found.camera) is type(written.cameras[0].camera) or "perspective" in name
        (ours, valid), (back, still_valid) = rig_rays(camera), rig_rays(found.camera)
        # where a domain ends by 1e-12, which rounding moves, no pixel's center of these is
        assert np.array_equal(valid, still_valid), name
        chords = np.linalg.norm(ours - back, axis=-1)  # radians, as small as they are
        assert chords[valid].max() < 1e-9, name
        size = camera.width_px, camera.height_px
        assert (found.camera.width_px, found.camera.height_px) == size
    assert exact == EXACT[form]


@pytest.mark.usefixtures("no_fits")
@pytest.mark.parametrize("path", EXACT_SAMPLES, ids=lambda path: path.name)
def test_a_file_of_its_own_format_keeps_every_bit(path, tmp_path):
    """Numbers, names and poses."""
    loaded = load_calibration(path)
    form = FORMATS[loaded.format]
    for one in loaded.cameras if not form.several else [None]:
        calibration = loaded if one is None else loaded.only(one.name)
        again = tmp_path / f"again{path.suffix}"
        calibration.save(again, loaded.format)
        back = load_calibration(again)
        for before, after in zip(calibration.cameras, back.cameras, strict=True):
            assert after.name == before.name
            (ours, valid), (theirs, still) = rig_rays(before.camera), rig_rays(after.camera)
            assert np.array_equal(valid, still)
            assert np.abs(ours - theirs).max() < 1e-15  # COLMAP's half pixel may cost a bit
            back_poses = {(one.target, one.source): one for one in after.poses}
            for pose in before.poses:
                same = back_poses[pose.target, pose.source].target_from_source
                # 1e-12: what quaternions cost
                np.testing.assert_allclose(same, pose.target_from_source, atol=1e-12)


@pytest.mark.usefixtures("no_fits")
@pytest.mark.parametrize("form", ["kalibr", "opencv_omnidir", "ocamcalib", "basalt", "gazebo"])
def test_mirror_is_written_as_a_lens_with_metadata(form, tmp_path):
    camera = CAMERA_EXAMPLES["planar"] if form == "gazebo" else CAMERA_EXAMPLES["parabolic"]
    path = tmp_path / f"mirror{FORMATS[form].suffix}"
    calibration_of(camera).save(path, form)
    assert '"mirrored": true' in path.read_text()
    mirror = load_calibration(path).cameras[0]
    assert mirror.camera.rig_from_optical[2, 2] == 1.0  # looks up
    # without the metadata it is the lens that its numbers are
    lens = load_calibration(path, mirrored=False).cameras[0].camera
    middle = camera.principal_point_px
    assert lens.ray_from_pixel(middle).directions[2] == pytest.approx(1.0)
    assert mirror.camera.ray_from_pixel(middle).directions[2] == pytest.approx(-1.0)


def test_a_fitted_mirror_is_a_mirrored_lens(tmp_path):
    camera = CAMERA_EXAMPLES["hyperbolic-paper"]
    path = tmp_path / "mirror.yaml"
    written = calibration_of(camera).save(path, "kalibr", model="kannala_brandt").cameras[0]
    found = load_calibration(path).cameras[0]
    assert isinstance(found.camera, MirroredCamera)
    assert found.camera == written.camera
    assert found.residuals.max_px == written.residuals.max_px
    (ours, valid), (back, still_valid) = rig_rays(camera), rig_rays(found.camera)
    both = valid & still_valid
    assert both.sum() > 0.99 * valid.sum()
    # a pixel is at least 0.5° wide there
    assert np.linalg.norm(ours - back, axis=-1)[both].max() < found.residuals.max_px * 0.02
