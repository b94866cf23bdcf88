"""Formats of photogrammetry, MATLAB and devices against their tools' own formulas, written anew."""

import json
import math

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from omnisim.cameras.calibration import calibration_of, load_calibration
from omnisim.cameras.calibration.calibrated_camera import find_pose
from omnisim.cameras.calibration.documents import parse_xml
from omnisim.cameras.calibration.formats.format import Intrinsics
from omnisim.cameras.calibration.formats.metashape import _tree
from omnisim.cameras.calibration.formats.photogrammetry import (
    HALF_A_PIXEL,
    BrownLens,
    lens_from_terms,
)
from omnisim.core.errors import CalibrationError, NoticeWarning
from omnisim.core.poses import inverse
from tests.camera_examples import CAMERA_EXAMPLES, points_around_axis
from tests.cameras.calibration.sample_files import FOLDER

PIXELS = np.stack(np.meshgrid(np.linspace(0.0, 1279.0, 33), np.linspace(0.0, 959.0, 25)), axis=-1)


def plane(kind, points, transition=0.5):
    """Points of the projection's plane."""
    x, y, z = points.T
    r = np.hypot(x, y)
    theta = np.arctan2(r, z)
    g = {
        "perspective": np.tan(theta),
        "fisheye": theta,
        "equisolid": 2.0 * np.sin(theta / 2.0),
        "dual": transition * np.tan(theta) + (1.0 - transition) * theta,
    }[kind]
    return x / r * g, y / r * g


def distorted(x, y, k=(), p1=0.0, p2=0.0, s=(0.0,) * 4):
    """Distortion as OpenSfM's C++ has it, of undistorted points."""
    r2 = x * x + y * y
    radial = 1.0 + sum(c * r2**n for n, c in enumerate(k, start=1))
    dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + s[0] * r2 + s[1] * r2 * r2
    dy = 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y) + s[2] * r2 + s[3] * r2 * r2
    return x * radial + dx, y * radial + dy


def save(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_opensfms_pixels_agree():
    cameras = json.loads((FOLDER / "camera_models.json").read_text())
    loaded = load_calibration(FOLDER / "camera_models.json")
    for found, (name, model) in zip(loaded.cameras, cameras.items(), strict=True):
        assert found.name == name
        points = points_around_axis(math.radians(30.0))
        if model["projection_type"] == "spherical":
            u = np.arctan2(points[:, 0], points[:, 2]) / (2.0 * math.pi)
            v = np.arctan2(points[:, 1], np.hypot(points[:, 0], points[:, 2])) / (2.0 * math.pi)
        else:
            is_fisheye = model["projection_type"].startswith("fisheye")
            x, y = plane("fisheye" if is_fisheye else "perspective", points)
            k = [model.get(f"k{n}", 0.0) for n in range(1, 5)]
            x, y = distorted(x, y, k, model.get("p1", 0.0), model.get("p2", 0.0))
            u = x * model.get("focal_x", model.get("focal")) + model.get("c_x", 0.0)
            v = y * model.get("focal_y", model.get("focal")) + model.get("c_y", 0.0)
        size = np.array([model["width"], model["height"]])
        theirs = np.stack((u, v), axis=-1) * size.max() + (size - 1) / 2.0
        ours = found.camera.pixel_from_ray(points).positions_px
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "projection", "values"),
    [
        ("fisheye62", "fisheye", {"k1": 0.02, "k2": -0.01, "p1": 3e-4, "p2": -5e-4}),
        ("fisheye624", "fisheye", {"k1": 0.02, "k6": 1e-5, "s0": 1e-3, "s1": -1e-4, "s2": 5e-4}),
        ("dual", "dual", {"k1": 0.02, "k2": -0.01, "transition": 0.3}),
    ],
)
def test_other_lenses_are_read_as_the_nearest_with_the_residual(kind, projection, values, tmp_path):
    focal = {"focal": 0.5} if kind == "dual" else {"focal_x": 0.5, "focal_y": 0.5}
    model = {"projection_type": kind, "width": 1280, "height": 960, **focal, **values}
    path = save(tmp_path, "camera_models.json", json.dumps({"a": model}))
    with pytest.warns(NoticeWarning, match="omnisim has no model brown: read as thin_prism_fish"):
        found = load_calibration(path).cameras[0]
    # the residual that the note states holds for the formula, at other points
    stated_px = float(found.notes[0].split("at most ")[1].split(" px")[0])
    points = points_around_axis(math.radians(60.0))
    k = [values.get(f"k{n}", 0.0) for n in range(1, 7)]
    s = [values.get(f"s{n}", 0.0) for n in range(4)]
    x, y = plane(projection, points, values.get("transition", 0.5))
    x, y = distorted(x, y, k, values.get("p1", 0.0), values.get("p2", 0.0), s)
    theirs = np.stack((x, y), axis=-1) * 640.0 + (639.5, 479.5)
    seen = found.camera.pixel_from_ray(points)
    inside = seen.valid & (np.abs(theirs - (639.5, 479.5)) <= (640.0, 480.0)).all(axis=-1)
    assert inside.sum() > 500
    off_px = np.linalg.norm(seen.positions_px - theirs, axis=-1)
    assert off_px[inside].max() < 1.05 * stated_px
    assert stated_px < 2.0


@pytest.mark.parametrize(
    ("projection", "values", "skew_px"),
    [
        ("perspective", {"k1": -0.11, "k2": 0.06, "k4": 0.003, "p1": 3e-4, "p2": -5e-4}, 0.0),
        ("fisheye", {"k1": 0.02, "p1": 3e-4, "s0": 1e-3, "s3": 1e-4}, 0.2),
        ("equisolid", {"k1": 0.0533, "k2": 0.0444, "k3": -0.0123, "p2": -4e-4}, 0.0),
        ("dual", {"k1": 0.02, "transition": 0.3}, 0.0),
    ],
)
def test_brown_lenses_are_their_formula_both_ways(projection, values, skew_px):
    intrinsics = Intrinsics(1280, 960, (700.0, 701.0), (650.0, 470.0))
    lens = lens_from_terms(intrinsics, projection, values, skew_px)
    assert isinstance(lens, BrownLens)
    rays = lens.ray_from_pixel(PIXELS)
    assert rays.valid.all()
    x, y = plane(projection, rays.directions.reshape(-1, 3), values.get("transition", 0.5))
    k, s = (
        [values.get(f"k{n}", 0.0) for n in range(1, 7)],
        [values.get(f"s{n}", 0.0) for n in range(4)],
    )
    x, y = distorted(x, y, k, values.get("p1", 0.0), values.get("p2", 0.0), s)
    theirs = np.stack((700.0 * x + skew_px * y + 650.0, 701.0 * y + 470.0), axis=-1)
    np.testing.assert_allclose(theirs, PIXELS.reshape(-1, 2), atol=1e-9)
    ours = lens.pixel_from_ray(rays.directions)
    assert ours.valid.all()
    np.testing.assert_allclose(ours.positions_px, PIXELS, atol=1e-9)


def test_a_reconstruction_has_poses_and_a_rig(tmp_path):
    model = {"projection_type": "fisheye", "width": 100, "height": 100, "focal": 0.3}
    turn, shift = [0.1, -0.2, 0.3], [1.0, 2.0, 3.0]
    shots = {
        name: {"rotation": turn, "translation": shift, "camera": "gopro", "scale": 1.0}
        for name in ("f1.jpg", "b1.jpg")
    }
    rig = {"front": {"rotation": [0.0] * 3, "translation": [0.0] * 3},
           "back": {"rotation": [0.0, math.pi, 0.0], "translation": [0.0, 0.0, -0.03]}}  # fmt: skip
    ids = {"f1.jpg": "front", "b1.jpg": "back"}
    first = {
        "cameras": {"gopro": model}, "shots": shots, "rig_cameras": rig, "points": {},
        "rig_instances": {"1": {**rig["front"], "rig_camera_ids": ids}},
    }  # fmt: skip
    path = save(tmp_path, "reconstruction.json", json.dumps([first, first]))
    with pytest.warns(NoticeWarning, match="1 more reconstructions are not read"):
        loaded = load_calibration(path)
    assert loaded.names == ["front", "back"]
    world = loaded.camera("front").poses[0]
    assert (world.target, world.source) == ("world", "f1.jpg")
    known = np.eye(4)
    known[:3, :3], known[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), shift
    np.testing.assert_allclose(world.target_from_source, inverse(known), atol=1e-12)
    poses = [pose for camera in loaded.cameras for pose in camera.poses]
    front_from_back = find_pose(poses, "front", "back")
    np.testing.assert_allclose(front_from_back[:3, 3], [0.0, 0.0, -0.03], atol=1e-12)
    np.testing.assert_allclose(np.diag(front_from_back)[:3], [-1.0, 1.0, -1.0], atol=1e-12)
    # cameras that never took images together are no rig
    alone = {name: {"rig_camera_ids": {name: rig}} for name, rig in ids.items()}
    path = save(tmp_path, "reconstruction.json", json.dumps([{**first, "rig_instances": alone}]))
    targets = [pose.target for one in load_calibration(path).cameras for pose in one.poses]
    assert targets == ["world", "world"]


def test_openmvgs_panoramas():
    cameras = load_calibration(FOLDER / "sfm_data.json").cameras
    assert cameras[2].notes == (HALF_A_PIXEL,)
    points = points_around_axis(math.radians(60.0))
    size = np.array([5376.0, 2688.0])
    lon = np.arctan2(points[:, 0], points[:, 2])
    lat = np.arctan2(-points[:, 1], np.hypot(points[:, 0], points[:, 2]))
    theirs = np.stack((lon, -lat), axis=-1) / (2.0 * math.pi) * size.max() + size / 2.0
    ours = cameras[2].camera.pixel_from_ray(points).positions_px
    np.testing.assert_allclose(theirs - ours, 0.5, atol=1e-9)


def test_one_focal_length_is_fitted_as_one(tmp_path):
    camera = CAMERA_EXAMPLES["f-theta-woodscape-like"]
    written = calibration_of(camera).save(tmp_path / "a.json", "openmvg").cameras[0]
    fx, fy = written.camera.focal_lengths_px
    assert fx == fy
    assert written.residuals.max_px < 1.0


METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<document version="2.3.0">
  <chunk label="Chunk 1">
    <sensors>
      <sensor id="0" label="front" type="equisolid_fisheye">
        <calibration type="equisolid_fisheye" class="initial">
          <resolution width="400" height="300"/><f>100</f>
        </calibration>
        <calibration type="equisolid_fisheye" class="adjusted">
          <resolution width="400" height="300"/><f>110</f>
        </calibration>
      </sensor>
      <sensor id="1" label="back" type="fisheye" master_id="0">
        <calibration type="fisheye" class="adjusted">
          <resolution width="400" height="300"/><f>120</f><cx>2</cx><k1>0.01</k1>
        </calibration>
        <rotation fixed="true">-1 0 0 0 1 0 0 0 -1</rotation>
        <location fixed="true">0 0.01 -0.03</location>
      </sensor>
    </sensors>
    <cameras>
      <camera id="0" sensor_id="0" label="f_1">
        <transform>1 0 0 0.5 0 1 0 0 0 0 1 2 0 0 0 1</transform>
      </camera>
      <group id="0"><camera id="1" sensor_id="1" master_id="0" label="b_1"/></group>
    </cameras>
    <transform>
      <rotation locked="false">0 -1 0 1 0 0 0 0 1</rotation>
      <translation>10 20 30</translation>
      <scale locked="false">2</scale>
    </transform>
  </chunk>
</document>
"""


def test_metashapes_projects_have_poses_and_slave_sensors(tmp_path):
    loaded = load_calibration(save(tmp_path, "cameras.xml", METASHAPE))
    front, back = loaded.cameras
    assert (front.name, front.camera.model_name, front.camera.focal_length_px) == (
        "front", "equisolid", 110.0,
    )  # fmt: skip
    assert back.camera.principal_point_px == (201.5, 149.5)
    (world,) = front.poses
    assert (world.target, world.source) == ("world", "f_1")
    np.testing.assert_allclose(world.target_from_source[:3, 3], (10.0, 21.0, 34.0))
    (rig,) = back.poses
    assert (rig.target, rig.source) == ("front", "back")
    np.testing.assert_allclose(rig.target_from_source[:3, 3], (0.0, 0.01, -0.03))


def test_keys_of_metashapes_projects_are_named(tmp_path):
    text = METASHAPE.replace(
        "<f>120</f>", "<f>120</f><corrections><coeffs>1 2</coeffs></corrections>"
    )
    shutter = '<property name="rolling_shutter" value="true"/><rotation'
    path = save(tmp_path, "cameras.xml", text.replace("<rotation fixed", f"{shutter} fixed"))
    first, second = load_calibration(path).camera("back").notes[:2]
    assert first.startswith("calibration.corrections = ")
    assert (
        second == "rolling_shutter = true: rolling shutter: [degradation.shutter] of a sensor file"
    )
    path = save(tmp_path, "cameras.xml", METASHAPE.replace("<f>120</f>", "<f>120</f><p3>0.1</p3>"))
    with pytest.raises(CalibrationError, match=r"back: calibration.p3 = 0.1: higher tangential"):
        load_calibration(path)


@pytest.mark.parametrize("name", ["unified-pinhole-with-k3", "metashape.xml"])
def test_metashapes_frame_cameras_agree(name, tmp_path):
    path = FOLDER / name
    if not path.exists():
        path = tmp_path / "a.xml"
        calibration_of(CAMERA_EXAMPLES[name]).save(path, "metashape")
    fields = _tree(parse_xml(path.read_text(), ""))
    points = points_around_axis(math.radians(25.0))
    x, y = plane("perspective", points)
    names = ("k1", "k2", "k3", "p1", "p2", "f", "b1", "b2", "cx", "cy")
    k1, k2, k3, p1, p2, f, b1, b2, cx, cy = (fields.get(name, 0.0) for name in names)
    r2 = x * x + y * y
    radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y
    yd = y * radial + p2 * (r2 + 2.0 * y * y) + 2.0 * p1 * x * y
    u = fields["width"] * 0.5 + cx + xd * f + xd * b1 + yd * b2
    v = fields["height"] * 0.5 + cy + yd * f
    ours = load_calibration(path).cameras[0].camera.pixel_from_ray(points).positions_px
    np.testing.assert_allclose(ours + 0.5, np.stack((u, v), axis=-1), atol=1e-9)


def test_matlabs_rays_agree():
    """As undistortFisheyePoints has them: pixels from 1, x right, y down, z forward."""
    fields = json.loads((FOLDER / "matlab_fisheye.json").read_text())
    camera = load_calibration(FOLDER / "matlab_fisheye.json").cameras[0].camera
    u, v = np.meshgrid(np.linspace(0.0, 2047.0, 33), np.linspace(0.0, 1535.0, 25))
    points = (
        np.stack((u.ravel() + 1.0, v.ravel() + 1.0)) - np.array(fields["DistortionCenter"])[:, None]
    )
    x, y = np.linalg.solve(fields["StretchMatrix"], points)
    rho = np.hypot(x, y)
    a0, a2, a3, a4 = fields["MappingCoefficients"]
    theirs = np.stack((x, y, a0 + a2 * rho**2 + a3 * rho**3 + a4 * rho**4), axis=-1)
    theirs /= np.linalg.norm(theirs, axis=-1, keepdims=True)
    ours = camera.ray_from_pixel(np.stack((u.ravel(), v.ravel()), axis=-1))
    assert ours.valid.all()
    np.testing.assert_allclose(ours.directions, theirs, atol=1e-12)


def test_matlabs_older_matrix_is_transposed_and_structures_are_read(tmp_path):
    fields = json.loads((FOLDER / "matlab_pinhole.json").read_text())
    known = load_calibration(FOLDER / "matlab_pinhole.json").cameras[0].camera
    assert known.principal_point_px == (562.6511, 354.7258)
    fields["IntrinsicMatrix"] = np.transpose(fields.pop("K")).tolist()
    for written in (fields, {"Intrinsics": fields}):
        path = save(tmp_path, "a.json", json.dumps(written))
        assert load_calibration(path).cameras[0].camera == known
        numbers = {key: value for key, value in fields.items() if isinstance(value, list)}
        savemat(tmp_path / "a.mat", {"params": numbers})
        assert load_calibration(tmp_path / "a.mat").cameras[0].camera == known


def test_a_fit_for_matlab_has_its_powers_alone(tmp_path):
    camera = CAMERA_EXAMPLES["f-theta-woodscape-like"]
    written = calibration_of(camera).save(tmp_path / "a.json", "matlab").cameras[0]
    assert written.camera.polynomial[1] == 0.0
    assert len(written.camera.polynomial) == 5
    found = load_calibration(tmp_path / "a.json").cameras[0]
    assert found.residuals.max_px == written.residuals.max_px < 1.0


def test_arias_projection_agrees():
    file = json.loads((FOLDER / "aria.json").read_text())
    loaded = load_calibration(FOLDER / "aria.json")
    for found, part in zip(loaded.cameras, file["CameraCalibrations"], strict=True):
        f, u, v, *terms = part["Projection"]["Params"]
        k, p, s = terms[:6], np.array(terms[6:8]), terms[8:]
        points = points_around_axis(math.radians(50.0))
        x, y = plane("fisheye", points)
        radial = 1.0 + sum(c * (x * x + y * y) ** n for n, c in enumerate(k, start=1))
        xy = np.stack((x * radial, y * radial), axis=-1)
        r2 = np.sum(xy * xy, axis=-1, keepdims=True)
        prism = np.hstack((s[0] * r2 + s[1] * r2**2, s[2] * r2 + s[3] * r2**2))
        theirs = f * (xy + 2.0 * (xy @ p)[:, None] * xy + r2 * p + prism) + (u, v)
        seen = found.camera.pixel_from_ray(points)
        assert seen.valid.all()
        np.testing.assert_allclose(seen.positions_px, theirs, atol=1e-9)
        (pose,) = found.poses
        assert (pose.target, pose.source) == ("device", part["Label"])
        at = part["T_Device_Camera"]["Translation"]
        np.testing.assert_allclose(pose.target_from_source[:3, 3], at, atol=1e-15)
    # the image circle of the device's SLAM cameras, 330 px
    slam = loaded.cameras[0].camera
    edge = slam.pixel_from_ray(_ray(slam.theta_max_rad - 1e-9)).positions_px
    assert min(slam.theta_max_rad, 1.4) == slam.theta_max_rad
    assert edge[0] - slam.principal_point_px[0] <= 330.0


def _ray(theta_rad):
    return np.array([math.sin(theta_rad), 0.0, math.cos(theta_rad)])


def test_arias_time_shift_and_circle_come_back(tmp_path):
    file = json.loads((FOLDER / "aria.json").read_text())
    part = file["CameraCalibrations"][0]
    part["TimeOffsetSec_Device_Camera"] = 0.25
    part["ConfigData"] = {"ImageWidth": 640, "ImageHeight": 480, "MaxSolidAngle": 1.2}
    loaded = load_calibration(save(tmp_path, "a.json", json.dumps(file)))
    assert loaded.cameras[0].time_shift_s == -0.25
    assert loaded.cameras[0].camera.theta_max_rad == 1.2
    loaded.save(tmp_path / "b.json", "aria")
    back = load_calibration(tmp_path / "b.json")
    assert [one.camera for one in back.cameras] == [one.camera for one in loaded.cameras]
    assert back.cameras[0].time_shift_s == -0.25


def test_arias_sizes_are_those_of_a_known_device_or_a_note_says_so(tmp_path):
    file = json.loads((FOLDER / "aria.json").read_text())
    del file["ImageSizes"]
    file["CameraCalibrations"] = file["CameraCalibrations"][2:]
    for device, side_px in (("Aria", 2880), ("Oatmeal", 4032), ("Walnut", 2880)):
        file["DeviceClassInfo"] = {"DeviceClass": device}
        path = save(tmp_path, "a.json", json.dumps(file))
        if device == "Walnut":
            with pytest.warns(NoticeWarning, match="DeviceClass = Walnut: an unknown device, of"):
                found = load_calibration(path)
        else:
            found = load_calibration(path)
        assert found.cameras[0].camera.width_px == side_px
    config = {"ImageWidth": 1408, "ImageHeight": 1408, "MaxSolidAngle": 1.0}
    file["CameraCalibrations"][0]["ConfigData"] = config
    file["ImageSizes"] = [[704, 704]]
    with pytest.warns(NoticeWarning, match="704 × 704, and ConfigData 1408 × 1408, which is read"):
        found = load_calibration(save(tmp_path, "a.json", json.dumps(file)))
    assert found.cameras[0].camera.width_px == 1408
    assert "Walnut" not in str(found.cameras[0].notes)


def test_arias_online_calibrations_are_refused_and_world_poses_are_no_rig(tmp_path):
    line = json.dumps(json.loads((FOLDER / "aria.json").read_text()))
    path = save(tmp_path, "online_calibration.jsonl", f"{line}\n{line}\n")
    with pytest.raises(CalibrationError, match=r"expected one calibration: .* got '2 of them'"):
        load_calibration(path)
    assert len(load_calibration(save(tmp_path, "a.json", line)).cameras) == 3
    load_calibration(FOLDER / "transforms.json").save(tmp_path / "b.json", "aria")
    assert load_calibration(tmp_path / "b.json").cameras[0].poses == ()


def test_insta360s_pixels_and_rig():
    numbers = [float(word) for word in (FOLDER / "insta360.txt").read_text().split("_")]
    loaded = load_calibration(FOLDER / "insta360.txt")
    for index, found in enumerate(loaded.cameras):
        xi, fx, fy, cx, cy, *_, k1, k2, k3, p1, p2, _, _, _ = numbers[1 + 19 * index :][:19]
        points = points_around_axis(math.radians(100.0))
        x, y, z = (points / np.linalg.norm(points, axis=-1, keepdims=True)).T
        x, y = distorted(x / (z + xi), y / (z + xi), (k1, k2, k3), p1, p2)
        theirs = np.stack((fx * x + cx - 5376.0 * index, fy * y + cy), axis=-1)
        seen = found.camera.pixel_from_ray(points)
        assert seen.valid.all()
        np.testing.assert_allclose(seen.positions_px, theirs, atol=1e-9)
        assert "yaw, pitch, roll" in found.notes[0]
    (pose,) = loaded.cameras[1].poses
    assert (pose.target, pose.source) == ("lens0", "lens1")
    np.testing.assert_allclose(pose.target_from_source[:3, 3], (0.000792, 0.000132, -0.031986))
    np.testing.assert_allclose(pose.target_from_source[:3, 2], (0.0, 0.0, -1.0), atol=1e-15)
