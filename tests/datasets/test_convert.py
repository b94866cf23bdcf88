"""Data sets in the layouts of other tools: poses, images and ranges are the samples'."""

import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner

from omnisim.apps.cli.app import app
from omnisim.cameras.calibration import load_calibration
from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.datasets.generate.samples import Shards
from tests.datasets.plans import write_plan

# Two pinholes, 0.1 m apart, and 30° between their axes, as Kalibr writes a chain.
KALIBR = """
cam0:
  camera_model: pinhole
  distortion_model: none
  distortion_coeffs: []
  intrinsics: [30.0, 30.0, 23.5, 15.5]
  resolution: [48, 32]
cam1:
  camera_model: pinhole
  distortion_model: none
  distortion_coeffs: []
  intrinsics: [30.0, 30.0, 23.5, 15.5]
  resolution: [48, 32]
  T_cn_cnm1:
  - [0.8660254037844387, 0.0, -0.5, -0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.5, 0.0, 0.8660254037844387, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
"""
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def _omnisim(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def _made(folder, text="", **keys):
    (folder / "chain.yaml").write_text(KALIBR)
    plan = write_plan(folder, text, **keys)
    plan.write_text(plan.read_text().replace("size_px = 32\n", ""))
    done = _omnisim("generate", plan, "-o", folder / "out")
    assert done.exit_code == 0, done.output
    return folder / "out"


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    return _made(
        folder,
        "[vary]\npitch_deg = [-5.0, 5.0]\nshift_m = [-0.1, 0.1]",
        camera='calibration = "chain.yaml"\ncamera_name = "all"',
        image_format="jpg",
        images_per_shard=2,
        channels=["range", "semantic", "instance"],
    )


def _converted(folder, target, form):
    done = _omnisim("dataset", "convert", folder, "--to", form, "-o", target)
    assert done.exit_code == 0, done.exception
    return target


def test_nerfstudio_has_the_poses_and_depths(rig, tmp_path):
    target = _converted(rig, tmp_path / "n", "nerfstudio")
    document = json.loads((target / "transforms.json").read_text())
    shards = Shards(rig)
    frames = {frame["file_path"]: frame for frame in document["frames"]}
    assert len(frames) == 2 * len(shards)
    for row in range(len(shards)):
        sample = shards[row]
        for name in ("cam0", "cam1"):
            frame = frames[f"images/{name}/{row:06d}.png"]
            truth = sample["metadata"]["images"][name]["world_from_optical"]
            found = np.array(frame["transform_matrix"]) @ OPENGL
            np.testing.assert_allclose(found, truth, atol=1e-9)
            pixels = read_image(target / frame["file_path"])[0]
            np.testing.assert_array_equal(pixels[..., :3], sample[name]["rgb"])
            depths = read_image(target / frame["depth_file_path"])[0][..., 0] / 1000.0
            u, v = np.meshgrid(np.arange(48), np.arange(32))
            cosines = 1.0 / np.sqrt(((u - 23.5) / 30.0) ** 2 + ((v - 15.5) / 30.0) ** 2 + 1.0)
            ranges = sample[name]["range"]
            hit = np.isfinite(ranges)
            np.testing.assert_allclose(depths[hit], (ranges * cosines)[hit], atol=2e-3)
            assert not depths[~hit].any()


def test_kitti360_has_the_labels_of_the_samples_and_the_poses_of_both_cameras(rig, tmp_path):
    target, shards = _converted(rig, tmp_path / "k", "kitti360"), Shards(rig)
    (folder,) = target.glob("data_2d_semantics/train/*")
    labels = json.loads((folder / "labels.json").read_text())
    assert [label["name"] for label in labels["instances"]] == ["horizon", "lines", "sphere"]
    for row in range(len(shards)):
        sample = shards[row]
        for name, kitti in (("cam0", "image_00"), ("cam1", "image_01")):
            path = folder / kitti / "instance" / f"{row:010d}.png"
            found = read_image(path)[0][..., 0] // 1000
            np.testing.assert_array_equal(found, sample[name]["semantic"])
    (poses_file,) = target.glob("data_poses/*/poses.txt")
    world_from_imu = np.loadtxt(poses_file)[:, 1:].reshape(-1, 3, 4)
    lines = (target / "calibration" / "calib_cam_to_pose.txt").read_text().splitlines()
    for name, line in zip(("cam0", "cam1"), lines, strict=False):
        imu_from_camera = np.eye(4)
        imu_from_camera[:3] = np.fromstring(line.partition(":")[2], sep=" ").reshape(3, 4)
        for row in range(len(shards)):
            truth = shards.metadata(row)["images"][name]["world_from_optical"]
            found = world_from_imu[row] @ imu_from_camera
            np.testing.assert_allclose(found, np.array(truth)[:3], atol=1e-8)


def test_colmap_has_tracks_of_the_ranges(rig, tmp_path):
    target = _converted(rig, tmp_path / "c", "colmap")
    lines = (target / "sparse" / "0" / "points3D.txt").read_text().splitlines()
    assert len([line for line in lines if not line.startswith("#")]) > 100
    assert len(list(target.glob("images/*/*.png"))) == 8
    camera = load_calibration(target / "sparse" / "0" / "cameras.txt").camera(None).camera
    assert (camera.width_px, camera.height_px) == (48, 32)


def test_each_scene_and_rig_has_a_folder(tmp_path):
    text = '[[cameras]]\nname = "left"\ncalibration = "chain.yaml"\n'
    text += '[[scenes]]\nfile = "soccer"\nweight = 2.0'
    out = _made(tmp_path, text, images_per_shard=8, shards=1)
    target = _converted(out, tmp_path / "n", "nerfstudio")
    found = {path.parent.relative_to(target).as_posix() for path in target.rglob("transforms.json")}
    assert found == {"rings/paper", "rings/left", "soccer/paper", "soccer/left"}
    documents = [json.loads(path.read_text()) for path in target.rglob("transforms.json")]
    assert sum(len(document["frames"]) for document in documents) == 8


def test_other_layouts_are_one_line(rig, tmp_path):
    done = _omnisim("dataset", "convert", rig, "--to", "nerf", "-o", tmp_path / "n")
    assert isinstance(done.exception, OmnisimError)
    assert "--to 'nerf': did you mean 'nerfstudio'" in str(done.exception)
    (tmp_path / "there").mkdir()
    done = _omnisim("dataset", "convert", rig, "--to", "colmap", "-o", tmp_path / "there")
    assert "already exists" in str(done.exception)


def test_cameras_that_vary_are_refused_but_for_coco(tmp_path):
    camera, text = "mount_turn_deg = [0.0, 2.0]", "[vary]\nimages_per_setup = 1"
    out = _made(tmp_path, text, camera=camera, channels=["instance"], images_per_shard=2, shards=1)
    done = _omnisim("dataset", "convert", out, "--to", "kitti360", "-o", tmp_path / "k")
    assert isinstance(done.exception, OmnisimError)
    assert "sample 1: camera differs from that of sample 0: expected cameras" in str(done.exception)
    assert not (tmp_path / "k").exists()
    assert _omnisim("dataset", "convert", out, "-o", tmp_path / "c").exit_code == 0


@pytest.mark.parametrize(
    ("where", "damage"),
    [(b'"number"', b"\xff"), (b'"images"', b"}"), (b'"world_from_base"', b"x"), (b'"model"', b"x")],
)
def test_damaged_samples_are_one_line(rig, tmp_path, where, damage):
    out = tmp_path / "out"
    shutil.copytree(rig, out)
    content = bytearray((out / "shard-000000.tar").read_bytes())
    at = content.find(where, content.find(b'{"number"')) + 2
    content[at : at + 1] = damage
    (out / "shard-000000.tar").write_bytes(content)
    done = _omnisim("dataset", "convert", out, "--to", "nerfstudio", "-o", tmp_path / "n")
    assert isinstance(done.exception, OmnisimError)
    assert "\n" not in str(done.exception)
    assert not (tmp_path / "n").exists()


def test_yolo_has_the_boxes_of_coco(tmp_path):
    out = tmp_path / "out"
    plan = write_plan(tmp_path, images_per_shard=4, shards=1, channels=["instance"])
    assert _omnisim("generate", plan, "-o", out).exit_code == 0
    coco = json.loads((_converted(out, tmp_path / "c", "coco") / "annotations.json").read_text())
    done = _omnisim("dataset", "convert", out, "--to", "yolo", "--split", "train=0.7,val=0.3",
                    "-o", tmp_path / "y")  # fmt: skip
    assert done.exit_code == 0, done.exception
    classes = (tmp_path / "y" / "classes.txt").read_text().split()
    assert classes == [one["name"] for one in coco["categories"]]
    for image in coco["images"]:
        label = (tmp_path / "y" / "labels" / image["file_name"]).with_suffix(".txt")
        found = np.loadtxt(label, ndmin=2).reshape(-1, 5)
        own = [one for one in coco["annotations"] if one["image_id"] == image["id"]]
        sizes = np.array([image["width"], image["height"]] * 2)
        boxes = np.array([one["bbox"] for one in own]).reshape(-1, 4)
        center, size = found[:, 1:3] * sizes[:2], found[:, 3:] * sizes[2:]
        np.testing.assert_allclose(np.hstack((center - size / 2, size)), boxes, atol=1e-4)
        assert found[:, 0].tolist() == [one["category_id"] - 1 for one in own]
    lists = [(tmp_path / "y" / f"{name}.txt").read_text().split() for name in ("train", "val")]
    images = sorted(path.name for path in (tmp_path / "y" / "images").iterdir())
    assert sorted(path.removeprefix("./images/") for one in lists for path in one) == images
    data = (tmp_path / "y" / "data.yaml").read_text()
    assert data.startswith("train: train.txt\nval: val.txt\nnames:\n  0: ")
