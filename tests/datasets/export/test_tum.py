"""TUM RGB-D, read by evo and OpenCV, and projected by the pinhole's formula."""

import json

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import ExportSettings

pytestmark = pytest.mark.usefixtures("needs_opengl")
START_NS = 1_769_860_800_123_456_789


def _export(run, folder, camera):
    notes = []
    list(export_run(run, "tum", folder, ExportSettings(START_NS), camera, notes.append))
    return notes


def _list(folder, name):
    lines = (folder / f"{name}.txt").read_text().splitlines()
    return [line.split() for line in lines if not line.startswith("#")]


def test_stamps_images_and_poses_belong_together(run, tmp_path, check_pixels, seen):
    file_interface = pytest.importorskip("evo.tools.file_interface")
    _export(run, tmp_path / "tum", "front")
    images = _list(tmp_path / "tum", "rgb")
    assert images[1] == ["1769860800.623456789", "rgb/1769860800.623456789.png"]
    truth = file_interface.read_tum_trajectory_file(tmp_path / "tum" / "groundtruth.txt")
    # at all that is recorded, and so at each image's stamp
    assert truth.num_poses > 31
    stamps = truth.timestamps.tolist()
    poses = [truth.poses_se3[stamps.index(float(stamp))] for stamp, _ in images]
    focal, center = 40.0, (31.5, 23.5)
    for step, (_, name) in enumerate(images):
        camera_from_world = np.linalg.inv(poses[step])
        points = seen("front", step).world_m @ camera_from_world[:3, :3].T
        points += camera_from_world[:3, 3]
        pixels = focal * points[:, :2] / points[:, 2:] + center
        check_pixels(pixels, read_image(tmp_path / "tum" / name)[0], "front", step)


def test_depths_are_along_the_axis_in_steps_of_a_fifth_of_a_millimeter(run, tmp_path, seen):
    cv2 = pytest.importorskip("cv2")
    notes = _export(run, tmp_path / "tum", "front")
    truth = np.loadtxt(tmp_path / "tum" / "groundtruth.txt")
    depths = _list(tmp_path / "tum", "depth")
    truth = truth[np.isin(truth[:, 0], [float(stamp) for stamp, _ in depths])]
    for step, (stamp, name) in enumerate(depths):
        assert stamp == _list(tmp_path / "tum", "rgb")[step][0]
        found = cv2.imread(str(tmp_path / "tum" / name), cv2.IMREAD_UNCHANGED)
        assert found.dtype == np.uint16
        expected = seen("front", step)
        forward = expected.world_m - truth[step, 1:4]
        x, y, z, w = truth[step, 4:]
        axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        depths_m = forward @ axis
        u, v = expected.pixels.T
        near = depths_m < 13.1
        assert near.any()
        np.testing.assert_allclose(found[v, u][near] / 5000.0, depths_m[near], atol=1.01e-4)
        assert np.all(found[v, u][~near] == 0)
    assert sum("cannot hold imu" in note for note in notes) == 1


def test_a_mirror_has_flipped_images_no_depths_and_says_so(run, tmp_path):
    notes = _export(run, tmp_path / "tum", "mirror")
    assert not (tmp_path / "tum" / "depth.txt").exists()
    assert any("mirror: no depth images" in note for note in notes)
    assert any("mirror: looks into a mirror: its images are flipped" in note for note in notes)
    name = _list(tmp_path / "tum", "rgb")[2][1]
    flipped, own = read_image(tmp_path / "tum" / name)[0], read_image(run / "mirror/000002.png")[0]
    np.testing.assert_array_equal(flipped, own[:, ::-1])
    calibration = json.loads((tmp_path / "tum" / "calibration.json").read_text())
    assert calibration["cameras"][0]["camera"]["model"] == "unified"
