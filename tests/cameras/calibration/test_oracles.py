"""Calibration files in the readers and projections of other tools."""

import dataclasses
import json
import math
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from omnisim.cameras import KannalaBrandtCamera, PerspectiveCamera, UnifiedCamera
from omnisim.cameras.calibration import calibration_of, load_calibration
from omnisim.cameras.calibration.calibrated_camera import find_pose
from omnisim.cameras.calibration.formats.isaac import PREFIX, lens_of_model
from tests.camera_examples import CAMERA_EXAMPLES, points_around_axis
from tests.cameras import formulas
from tests.cameras.calibration.sample_files import FOLDER

WITHIN_PX = 1e-6
NO_TURN = np.zeros(3)


def _assert_same(camera, points, pixels, within_px=WITHIN_PX):
    ours = camera.pixel_from_ray(points)
    assert ours.valid.all()
    off = np.abs(ours.positions_px - np.asarray(pixels).reshape(-1, 2))
    assert off.max() < within_px


def _seen(camera, largest_theta_rad):
    points = points_around_axis(largest_theta_rad)
    points = points[camera.pixel_from_ray(points).valid]
    assert len(points) > 300
    return points


def _matrices(cv2, path):
    """K, D, ξ or 0, and the image's size, as cv2.FileStorage reads them."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened()
    xi = storage.getNode("xi")
    return (
        storage.getNode("camera_matrix").mat(),
        storage.getNode("distortion_coefficients").mat(),
        0.0 if xi.empty() else xi.real(),
        (storage.getNode("image_width").real(), storage.getNode("image_height").real()),
    )


@pytest.mark.parametrize(
    "name",
    ["hyperbolic-paper", "unified-kitti-360", "unified-barrel-fold", "unified-kalibr", "parabolic"],
)
def test_opencv_reads_our_omnidir_file_and_projects_the_same(name, tmp_path):
    cv2 = pytest.importorskip("cv2", reason="OpenCV is an optional oracle")
    if not hasattr(cv2, "omnidir"):
        pytest.skip("OpenCV without its contributed modules has no omnidir")
    camera = CAMERA_EXAMPLES[name]
    calibration_of(camera).save(tmp_path / "a.yaml", "opencv_omnidir")
    k, d, xi, size = _matrices(cv2, tmp_path / "a.yaml")
    assert size == (camera.width_px, camera.height_px)
    looks_up = camera.rig_from_optical[2, 2] == 1.0
    points = points_around_axis(math.radians(100.0))
    flip = np.array([1.0, 1.0, -1.0]) if looks_up else np.ones(3)
    points = points[camera.pixel_from_ray(points * flip).valid]
    assert len(points) > 300
    pixels, _ = cv2.omnidir.projectPoints(points[:, None], NO_TURN, NO_TURN, k, xi, d)
    _assert_same(camera, points * flip, pixels)


@pytest.mark.parametrize(
    ("kind", "name", "widest_deg"),
    [
        ("fisheye", "kannala-brandt-tum-vi", 80.0),  # past 90° OpenCV is wrong
        ("pinhole", "unified-pinhole-with-k3", 45.0),
        ("pinhole", "rational-polynomial-kinect", 70.0),
        ("pinhole", "rational-polynomial-wide", 70.0),
        ("pinhole", "rational-polynomial-tilted-to-its-fold", 70.0),
    ],
)
def test_opencv_reads_our_file_and_projects_the_same(kind, name, widest_deg, tmp_path):
    cv2 = pytest.importorskip("cv2", reason="OpenCV is an optional oracle")
    camera = CAMERA_EXAMPLES[name]
    calibration_of(camera).save(tmp_path / "a.yaml", f"opencv_{kind}")
    k, d, _, _ = _matrices(cv2, tmp_path / "a.yaml")
    points = _seen(camera, math.radians(widest_deg))
    project = cv2.fisheye.projectPoints if kind == "fisheye" else cv2.projectPoints
    pixels, _ = project(points[:, None], NO_TURN, NO_TURN, k, d)
    _assert_same(camera, points, pixels)


@pytest.mark.parametrize("form", ["opencv_fisheye", "ros"])
def test_a_skewed_fisheye_is_opencvs_with_alpha(form, tmp_path):
    cv2 = pytest.importorskip("cv2", reason="OpenCV is an optional oracle")
    camera = CAMERA_EXAMPLES["kannala-brandt-skewed"]
    written = calibration_of(camera).save(tmp_path / "a.yaml", form)
    points = _seen(camera, math.radians(70.0))
    fx, fy = camera.focal_lengths_px
    k = np.array([[fx, camera.skew_px, 160.25], [0.0, fy, 118.5], [0.0, 0.0, 1.0]])
    d = np.array(camera.coefficients)
    alpha = camera.skew_px / fx
    pixels, _ = cv2.fisheye.projectPoints(points[:, None], NO_TURN, NO_TURN, k, d, alpha=alpha)
    again = load_calibration(tmp_path / "a.yaml").cameras[0].camera
    _assert_same(again, points, pixels, 1e-9)
    rays = again.ray_from_pixel(pixels.reshape(-1, 2)).directions
    assert np.abs(rays - points / np.linalg.norm(points, axis=1)[:, None]).max() < 1e-12
    # what the note says of OpenCV's undistortion, at the first and at the last row
    (note,) = written.cameras[0].notes
    assert note == "OpenCV's undistortion ignores the skew: it is up to 2 px off"
    first = np.array([[[160.25, 0.0]]])
    plain = cv2.fisheye.undistortPoints(
        first, np.diag([fx, fy, 1.0]) + [[0, 0, 160.25], [0, 0, 118.5], [0, 0, 0]], d
    )
    np.testing.assert_array_equal(cv2.fisheye.undistortPoints(first, k, d), plain)


def test_isaacs_f_theta_is_its_polynomial_of_the_radius():
    camera = load_calibration(FOLDER / "isaac_ftheta.usda").cameras[0]
    lens, (pose,) = camera.camera, camera.poses
    u, v = np.meshgrid(np.linspace(100.0, 1800.0, 41), np.linspace(0.0, 1215.0, 31))
    x, y = u + 0.5 - 970.9424, v + 0.5 - 600.3748  # from the corner of the first pixel
    r = np.hypot(x, y)
    theta = r * (0.00205 + r * (1.25e-8 + r * (-1.1e-10 + r * 2.5e-13)))
    expected = np.stack((np.sin(theta) * x / r, np.sin(theta) * y / r, np.cos(theta)), axis=-1)
    seen = theta <= math.radians(95.0)
    rays = lens.ray_from_pixel(np.stack((u, v), axis=-1))
    assert np.array_equal(rays.valid, seen)
    assert 0.05 < 1.0 - seen.mean() < 0.95
    assert np.abs(rays.directions - expected)[seen].max() / 0.00205 < 1e-9  # in pixels
    back = lens.pixel_from_ray(expected[seen])
    assert back.valid.all()
    assert np.abs(back.positions_px - np.stack((u, v), axis=-1)[seen]).max() < 1e-9
    # the camera of USD looks along its -z, which is x of the base
    assert (pose.target, pose.source) == ("base", "front")
    np.testing.assert_array_equal(pose.target_from_source @ (0, 0, 1, 0), (1, 0, 0, 0))
    np.testing.assert_array_equal(pose.target_from_source @ (0, 1, 0, 0), (0, 0, -1, 0))
    np.testing.assert_array_equal(pose.target_from_source[:3, 3], (1.5, 0.25, 1.125))


@pytest.mark.parametrize("reference", ["ANGLE_TO_PIXELDIST", "PIXELDIST_TO_ANGLE"])
def test_nurecs_f_theta_is_gsplats(reference, tmp_path):
    """Polynomials in both directions, and the matrix [[c, d], [e, 1]] after them."""
    document = json.loads((FOLDER / "nurec.json").read_text())
    (entry,) = document["camera_calibrations"].values()
    values = entry["camera_model"]["parameters"]
    values["reference_poly"] = reference
    (tmp_path / "a.json").write_text(json.dumps(document))
    loaded = load_calibration(tmp_path / "a.json").cameras[0]
    camera, end = loaded.camera, values["max_angle"]
    c, d, e = values["linear_cde"]
    azimuth = np.linspace(0.0, math.tau, 60)
    across = np.stack((np.cos(azimuth), np.sin(azimuth)), axis=-1)
    if reference == "ANGLE_TO_PIXELDIST":
        theta = np.linspace(0.0, end - 1e-9, 50)
        radius = np.polynomial.polynomial.polyval(theta, values["angle_to_pixeldist_poly"])
    else:
        radius = np.linspace(0.0, 500.0, 50)
        theta = np.polynomial.polynomial.polyval(radius, values["pixeldist_to_angle_poly"])
        assert theta.max() < end
    x, y = (radius[:, None, None] * across).transpose(2, 0, 1)
    pixels = np.stack((c * x + d * y, e * x + y), axis=-1) + values["principal_point"]
    sine, cosine = np.sin(theta)[:, None, None], np.cos(theta)[:, None, None]
    rays = np.concatenate((sine * across, np.broadcast_to(cosine, (50, 60, 1))), axis=-1)
    _assert_same(camera, rays.reshape(-1, 3), pixels, 1e-9)
    back = camera.ray_from_pixel(pixels)
    assert back.valid.all()
    assert np.abs(back.directions - rays)[1:].max() * 473.0 < 1e-9
    # written, with the other polynomial fitted: no note on it
    written = calibration_of(camera).save(tmp_path / "b.json", "nurec")
    again = load_calibration(tmp_path / "b.json").cameras[0]
    assert written.cameras[0].residuals is None
    assert (again.camera, again.notes) == (camera, ())


@pytest.mark.parametrize("unit", ["1", "0.01"])
def test_isaacs_values_that_are_left_out_are_the_schemas(unit, tmp_path):
    path = tmp_path / "a.usda"
    path.write_text(
        f'#usda 1.0\n(\n    metersPerUnit = {unit}\n)\ndef Camera "a" (\n    prepend apiSchemas = '
        '["OmniLensDistortionFthetaAPI"]\n)\n{\n    matrix4d xformOp:transform = '
        "( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (200, 0, 0, 1) )\n}\n"
    )
    camera = load_calibration(path).cameras[0]
    assert camera.camera.coefficients == (0.00245,)
    assert (camera.camera.width_px, camera.camera.height_px) == (1936, 1216)
    assert camera.camera.principal_point_px == pytest.approx((970.4424, 599.8748))
    assert camera.camera.theta_max_rad == pytest.approx(math.radians(100.0))
    assert camera.poses[0].target_from_source[0, 3] == pytest.approx(200 * float(unit))


@pytest.mark.parametrize(
    "name", ["f-theta-inverse", "kannala-brandt-tum-vi", "rational-polynomial-wide"]
)
def test_usd_reads_our_stage(name, tmp_path):
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is an optional oracle")
    path = tmp_path / "a.usda"
    rig = load_calibration(FOLDER / "kalibr_tum_vi.yaml")
    poses = [pose for camera in rig.cameras for pose in camera.poses]
    lens = CAMERA_EXAMPLES[name]
    cameras = [dataclasses.replace(camera, camera=lens) for camera in rig.cameras]
    dataclasses.replace(rig, cameras=tuple(cameras)).save(path, "isaac")
    stage = usd.Stage.Open(str(path))
    back = load_calibration(path)
    for camera, ours in zip(back.cameras, rig.cameras, strict=True):
        prim = stage.GetPrimAtPath(f"/imu/{camera.name}")
        (schema,) = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
        assert schema.startswith("OmniLensDistortion")
        read = prim.GetAttribute("xformOp:transform").Get()
        theirs = np.array(read).T @ np.diag([1.0, -1.0, -1.0, 1.0])
        np.testing.assert_allclose(theirs, camera.poses[0].target_from_source, atol=1e-15)
        expected = find_pose(poses, "imu", ours.name)
        np.testing.assert_allclose(theirs, expected, atol=1e-12)
        theirs = lens_of_model(
            model := prim.GetAttribute("omni:lensdistortion:model").Get(),
            lambda key, of=prim, at=model: of.GetAttribute(f"{PREFIX}{at}:{key}").Get(),
        )
        pixels = theirs.pixel_from_ray(_seen(lens, math.radians(60.0))).positions_px
        _assert_same(lens, _seen(lens, math.radians(60.0)), pixels, 1e-3)  # of 32-bit floats


def test_basalts_radtan8_ends_at_rpmax():
    """Monado's formula, and its bound on the undistorted radius."""
    path = FOLDER / "basalt_radtan8.json"
    stated = json.loads(path.read_text())["value0"]["intrinsics"][0]["intrinsics"]
    fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6, rpmax = stated.values()
    camera = load_calibration(path).cameras[0].camera
    azimuth = np.linspace(0.0, math.tau, 60)
    radius = np.linspace(0.0, rpmax, 40)[:, None]
    x, y = radius * np.cos(azimuth), radius * np.sin(azimuth)
    r2 = x * x + y * y
    g = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    u = fx * (g * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
    v = fy * (g * y + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)) + cy
    rays = np.stack((x, y, np.ones_like(x)), axis=-1)
    seen = camera.pixel_from_ray(rays)
    assert seen.valid.all()
    assert np.abs(seen.positions_px - np.stack((u, v), axis=-1)).max() < 1e-9
    back = camera.ray_from_pixel(seen.positions_px[:-1])
    assert back.valid.all()
    plane = back.directions[..., :2] / back.directions[..., 2:]
    assert np.abs(plane - rays[:-1, :, :2]).max() * fx < 1e-9
    beyond = rays[-1] * (1.0 + 1e-9, 1.0 + 1e-9, 1.0)
    assert not camera.pixel_from_ray(beyond).valid.any()
    assert camera.ray_from_pixel((639.0, 0.0)).valid == (rpmax > 1.5)


@pytest.mark.parametrize("name", ["kannala-brandt-skewed", "unified-skewed"])
def test_formats_without_skew_state_what_it_costs(name, tmp_path):
    camera = CAMERA_EXAMPLES.get(name) or dataclasses.replace(
        CAMERA_EXAMPLES["unified-kitti-360"], skew_px=3.0
    )
    written = calibration_of(camera).save(tmp_path / "a.yaml", "kitti360").cameras[0]
    assert written.camera.skew_px == 0.0
    # the skew is s y_d, of which a shifted and stretched lens takes a part
    assert 0.1 < written.residuals.max_px < 10.0


@pytest.mark.parametrize("kind", ["omnidir", "fisheye", "pinhole"])
def test_files_that_opencv_writes_are_read(kind, tmp_path):
    cv2 = pytest.importorskip("cv2", reason="OpenCV is an optional oracle")
    k = np.array([[301.25, 0.0, 320.5], [0.0, 302.75, 239.125], [0.0, 0.0, 1.0]])
    d = np.array([[1e-5, -0.02, 1.0 / 3.0, 2e-7]])
    path = tmp_path / "theirs.yaml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", k)
    storage.write("distortion_coefficients", d)
    if kind == "omnidir":
        storage.write("xi", np.array([[1.25]]))
    storage.release()
    camera = load_calibration(path, f"opencv_{kind}").cameras[0].camera
    assert camera.focal_lengths_px == (301.25, 302.75)
    assert camera.principal_point_px == (320.5, 239.125)
    known = camera.coefficients if kind == "fisheye" else camera.distortion
    assert known == tuple(d[0])
    assert isinstance(camera, KannalaBrandtCamera if kind == "fisheye" else UnifiedCamera)


def _colmaps_cameras(folder):
    """COLMAP's cameras of a folder with a cameras.txt."""
    pycolmap = pytest.importorskip("pycolmap", reason="COLMAP is an optional oracle")
    for other in ("images.txt", "points3D.txt", "rigs.txt", "frames.txt"):
        (folder / other).write_text("# none\n")
    return pycolmap.Reconstruction(str(folder)).cameras


@pytest.mark.parametrize(
    ("name", "widest_deg"),
    [("perspective-off-center", 70.0), ("kannala-brandt-tum-vi", 89.0), ("eucm", 89.0),
     ("equirectangular-odd", 179.0), ("unified-pinhole-with-k3", 40.0),
     ("rational-polynomial-kinect", 60.0), ("thin-prism-fisheye-aria", 89.0),
     ("division", 89.0), ("division-to-its-fold", 80.0)],
)  # fmt: skip
def test_colmap_reads_our_cameras_and_projects_the_same(name, widest_deg, tmp_path):
    camera = CAMERA_EXAMPLES[name]
    calibration_of(camera).save(tmp_path / "cameras.txt", "colmap")
    points = _seen(camera, math.radians(widest_deg))
    # the first pixel's center is at (0.5, 0.5)
    _assert_same(camera, points, _colmaps_cameras(tmp_path)[1].img_from_cam(points) - 0.5)


def test_the_colmap_samples_are_what_colmap_reads(tmp_path):
    shutil.copy(FOLDER / "colmap_cameras.txt", tmp_path / "cameras.txt")
    theirs = _colmaps_cameras(tmp_path)
    for found in load_calibration(FOLDER / "colmap_cameras.txt").cameras:
        points = _seen(found.camera, math.radians(35.0))
        pixels = theirs[int(found.name)].img_from_cam(points) - 0.5
        _assert_same(found.camera, points, pixels)


@pytest.mark.parametrize("name", ["hyperbolic-paper", "kannala-brandt-tum-vi", "eucm"])
def test_a_plain_yaml_reader_finds_floats_for_kalibr(name, tmp_path):
    """Kalibr takes no integer, and PyYAML takes 1e-05 for a word."""
    camera = CAMERA_EXAMPLES[name]
    tiny = dataclasses.replace(camera, principal_point_px=(1e-5, 250.0))
    calibration_of(tiny).save(tmp_path / "camchain.yaml", "kalibr")
    document = yaml.safe_load((tmp_path / "camchain.yaml").read_text())["cam0"]
    numbers = document["intrinsics"] + document["distortion_coeffs"]
    assert all(type(number) is float for number in numbers)
    assert document["intrinsics"][-2:] == [1e-5, 250.0]
    assert document["resolution"] == [camera.width_px, camera.height_px]


def test_matlabs_ocamcalib_counts_from_one(tmp_path):
    text = (FOLDER / "ocamcalib.txt").read_text()
    (tmp_path / "m.txt").write_text(text.replace("starting from 0 (C", "starting from 1 (MATLAB"))
    ours, theirs = (
        load_calibration(path).cameras[0].camera.principal_point_px
        for path in (FOLDER / "ocamcalib.txt", tmp_path / "m.txt")
    )
    assert ours == (309.9506845, 250.7950823902723)  # column, row
    np.testing.assert_allclose(np.subtract(ours, theirs), 1.0)


def _scaramuzza_cam2world(text, row, column):
    """The toolbox's rays (n, 3): x down, y right; written anew from its paper."""
    numbers = [
        [float(word) for word in line.split()]
        for line in text.splitlines()
        if line.strip() and not line.startswith("#")
    ]
    (_, *polynomial), (_, *inverse), (xc, yc), (c, d, e), _ = numbers
    xy = np.linalg.solve([[c, d], [e, 1.0]], np.stack((row - xc, column - yc)))
    rho = np.hypot(*xy)
    z = np.polynomial.polynomial.polyval(rho, polynomial)
    return np.stack((xy[0], xy[1], z), axis=-1), rho, inverse


@pytest.mark.parametrize("name", ["ocamcalib-fisheye", "parabolic-off-center"])
def test_scaramuzzas_functions_agree_with_our_ocamcalib_file(name, tmp_path):
    camera = CAMERA_EXAMPLES[name]
    calibration_of(camera).save(tmp_path / "a.txt", "ocamcalib")
    text = (tmp_path / "a.txt").read_text()
    v, u = (grid.ravel() for grid in np.mgrid[: camera.height_px : 9, : camera.width_px : 9])
    theirs, rho, inverse = _scaramuzza_cam2world(text, v.astype(float), u.astype(float))
    theirs /= np.linalg.norm(theirs, axis=-1, keepdims=True)
    ours = camera.ray_from_pixel(np.stack((u, v), axis=-1))
    depth = -1.0 if camera.rig_from_optical[2, 2] == 0.0 else 1.0  # a lens looks along their −z
    turned = np.stack((theirs[:, 1], theirs[:, 0], depth * theirs[:, 2]), axis=-1)
    assert np.abs(turned - ours.directions)[ours.valid].max() < 1e-12
    # and the way back, whose polynomial is only a fit: to the toolbox's hundredth of a pixel
    theta = np.arctan2(theirs[:, 2], np.hypot(theirs[:, 0], theirs[:, 1]))
    found = np.polynomial.polynomial.polyval(theta, inverse)
    assert np.abs(found - rho)[ours.valid].max() < 0.011


def test_woodscapes_own_projection_agrees():
    path = FOLDER / "woodscape_fv.json"
    points = points_around_axis(math.radians(95.0))
    pixels = formulas.woodscape(json.loads(path.read_text())["intrinsic"], *points.T)
    _assert_same(load_calibration(path).cameras[0].camera, points, pixels)


def test_basalts_double_sphere_agrees():
    path = FOLDER / "basalt_tum_vi_ds.json"
    value = json.loads(path.read_text())["value0"]["intrinsics"][0]["intrinsics"]
    found = load_calibration(path).cameras[0]
    points = points_around_axis(math.radians(100.0))
    focals, center = (value["fx"], value["fy"]), (value["cx"], value["cy"])
    given = SimpleNamespace(focal_lengths_px=focals, principal_point_px=center, **value)
    _assert_same(found.camera, points, formulas.double_sphere(given, *points.T))
    # the camera sits some centimeters beside the IMU, its axis along the IMU's −y
    (pose,) = found.poses
    assert (pose.target, pose.source) == ("imu", "cam0")
    assert pose.target_from_source[1, 2] < -0.99


def test_gazebos_lens_agrees():
    """r in half widths, f such that half of horizontal_fov reaches the edge."""
    fisheye, stereographic, pinhole = load_calibration(FOLDER / "gazebo.sdf").cameras
    theta = np.array([0.1, 0.7, 1.5])
    rays = np.stack((np.sin(theta), 0.0 * theta, np.cos(theta)), axis=-1)
    f = 1.0 / (1.05 * math.tan(3.14159 / 2.0 / 4.0))
    u = 399.5 + 400.0 * 1.05 * f * np.tan(theta / 4.0)
    _assert_same(fisheye.camera, rays, np.stack((u, np.full(3, 299.5)), axis=-1))
    f = 1.0 / (2.0 * math.tan(3.4 / 2.0 / 2.0))
    u = 319.5 + 320.0 * 2.0 * f * np.tan(theta / 2.0)
    _assert_same(stereographic.camera, rays, np.stack((u, np.full(3, 319.5)), axis=-1))
    assert pinhole.camera == PerspectiveCamera.with_field_of_view(320, 240, 1.047)


def test_nerfstudios_rays_agree(tmp_path):
    """Through (u + 0.5, v + 0.5), y up and z back."""
    camera = CAMERA_EXAMPLES["equirectangular"]
    calibration_of(camera).save(tmp_path / "a.json", "nerfstudio")
    document = json.loads((tmp_path / "a.json").read_text())
    u, v = np.array([0.0, 17.0, 399.0]), np.array([0.0, 80.0, 199.0])
    x = (u + 0.5 - document["cx"]) / document["fl_x"]
    y = -(v + 0.5 - document["cy"]) / document["fl_y"]
    theta, phi = -math.pi * x, math.pi * (0.5 - y)  # its equirectangular camera
    theirs = np.stack(
        (-np.sin(theta) * np.sin(phi), np.cos(phi), -np.cos(theta) * np.sin(phi)), axis=-1
    )
    ours = camera.ray_from_pixel(np.stack((u, v), axis=-1)).directions
    np.testing.assert_allclose(ours * (1.0, -1.0, -1.0), theirs, atol=1e-12)


def test_nerfstudios_poses_are_opengls():
    found = load_calibration(FOLDER / "transforms.json").cameras[0]
    first = found.poses[0]
    assert (first.target, first.source) == ("world", "images/frame_00001.jpeg")
    # it stands upright and looks along the world's +y: z back is −y
    np.testing.assert_allclose(first.target_from_source[:3, 2], (0.0, 1.0, 0.0))
    np.testing.assert_allclose(first.target_from_source[:3, 1], (0.0, 0.0, -1.0))  # down
    np.testing.assert_allclose(first.target_from_source[:3, 3], (0.5, -2.0, 1.25))
