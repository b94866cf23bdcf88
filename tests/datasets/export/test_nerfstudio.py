"""Nerfstudio's data set, by its documented conventions and by our own reader of it."""

import json
import shutil

import numpy as np
import pytest
import trimesh

from omnisim.cameras.calibration import load_calibration
from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.recording import Recording

pytestmark = pytest.mark.usefixtures("needs_opengl")


def _export(run, folder, camera):
    list(export_run(run, "nerfstudio", folder, camera_name=camera))
    return json.loads((folder / "transforms.json").read_text())


def _project(document, points, world_from_camera):
    """Pixels by nerfstudio's convention: x right, y up, z back; the first pixel is at 0.5."""
    local = (points - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    x, y, z = local[:, 0], -local[:, 1], -local[:, 2]
    if document["camera_model"] == "PINHOLE":
        x, y = x / z, y / z
    else:
        theta = np.arctan2(np.hypot(x, y), z)
        k1, k2, k3, k4 = (document[f"k{index}"] for index in (1, 2, 3, 4))
        radius = theta * (1 + k1 * theta**2 + k2 * theta**4 + k3 * theta**6 + k4 * theta**8)
        x, y = np.stack((x, y)) * radius / np.maximum(np.hypot(x, y), 1e-12)
    u = document["fl_x"] * x + document["cx"] - 0.5
    v = document["fl_y"] * y + document["cy"] - 0.5
    return np.stack((u, v), axis=-1)


@pytest.mark.parametrize(
    ("name", "model", "within_px"),
    [("front", "PINHOLE", 1e-3), ("fisheye", "OPENCV_FISHEYE", 1e-3),
     ("mirror", "OPENCV_FISHEYE", 0.01)],  # fitted
)  # fmt: skip
def test_points_project_to_their_pixels(run, tmp_path, seen, check_pixels, name, model, within_px):
    document = _export(run, tmp_path / "out", name)
    assert document["camera_model"] == model
    assert len(document["frames"]) == 4
    for step, frame in enumerate(document["frames"]):
        pixels = _project(document, seen(name, step).world_m, np.array(frame["transform_matrix"]))
        image = read_image(tmp_path / "out" / frame["file_path"])[0]
        check_pixels(pixels, image, name, step, within_px)
        assert ("mask_path" in frame) == (name != "front")
        assert ("depth_file_path" in frame) == (name == "front")


def test_our_own_reader_takes_the_poses_back(run, tmp_path):
    _export(run, tmp_path / "out", "fisheye")
    (camera,) = load_calibration(tmp_path / "out" / "transforms.json").cameras
    recording = Recording.read(run, "fisheye")
    expected = recording.truth.world_from_base @ recording.cameras[0].mount.base_from_optical
    np.testing.assert_allclose(
        [pose.target_from_source for pose in camera.poses], expected, atol=1e-12
    )


def test_depths_are_along_the_axis_in_millimeters(run, tmp_path, seen):
    document = _export(run, tmp_path / "out", "front")
    for step, frame in enumerate(document["frames"]):
        found = read_image(tmp_path / "out" / frame["depth_file_path"])[0][..., 0]
        assert found.dtype == np.uint16
        pose = np.array(frame["transform_matrix"])
        expected = seen("front", step)
        depths_m = -(expected.world_m - pose[:3, 3]) @ pose[:3, 2]
        u, v = expected.pixels.T
        np.testing.assert_allclose(found[v, u], 1000.0 * depths_m, atol=0.51)


def test_points_to_begin_with_lie_on_the_scene(run, tmp_path, seen):
    document = _export(run, tmp_path / "out", "front")
    cloud = trimesh.load(tmp_path / "out" / document["ply_file_path"])
    every = np.concatenate([seen("front", step).world_m for step in range(4)])
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(every).query(cloud.vertices)
    assert len(cloud.vertices) > 1000
    assert distances.max() < 1e-5


def test_cameras_of_several_models_are_refused_and_of_one_have_their_own_numbers(run, tmp_path):
    with pytest.raises(OmnisimError, match="expects one camera_model, got OPENCV_FISHEYE, PINHOLE"):
        list(export_run(run, "nerfstudio", tmp_path / "out"))
    shutil.copytree(run, tmp_path / "run")
    manifest = json.loads((run / "manifest.json").read_text())
    del manifest["sensors"]["front"]
    (tmp_path / "run" / "manifest.json").write_text(json.dumps(manifest))
    document = _export(tmp_path / "run", tmp_path / "two", None)
    assert len(document["frames"]) == 8
    assert "fl_x" not in document
    assert len({frame["fl_x"] for frame in document["frames"]}) == 2
