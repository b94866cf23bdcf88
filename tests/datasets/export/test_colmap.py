"""COLMAP's reconstruction, read and projected by pycolmap."""

import json
import shutil

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.recording import Recording

pytestmark = pytest.mark.usefixtures("needs_opengl")
CAMERAS = ("front", "fisheye", "mirror")


@pytest.fixture(scope="module")
def pycolmap():
    return pytest.importorskip("pycolmap")


@pytest.fixture(scope="module")
def colmap(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("colmap") / "out"
    notes = []
    list(export_run(run, "colmap", folder, print_note=notes.append))
    assert any("mirror: sees" in note and "ends at 90°" in note for note in notes)
    return folder


@pytest.mark.parametrize("name", CAMERAS)
def test_points_project_to_their_pixels(colmap, pycolmap, seen, check_pixels, name):
    found = pycolmap.Reconstruction(colmap / "sparse" / "0")
    by_name = {image.name: image for image in found.images.values()}
    assert set(by_name) == {f"{camera}/{step:06d}.png" for camera in CAMERAS for step in range(4)}
    for step in range(4):
        image = by_name[f"{name}/{step:06d}.png"]
        camera = found.cameras[image.camera_id]
        points = seen(name, step).world_m
        local = points @ image.cam_from_world().rotation.matrix().T
        local += image.cam_from_world().translation
        shown = local[:, 2] > 1e-3  # COLMAP projects nothing at or past 90°
        pixels = np.array([camera.img_from_cam(point) for point in local[shown]])
        rgb = read_image(colmap / "images" / image.name)[0]
        check_pixels(pixels - 0.5, rgb, name, step, shown=shown)
        assert shown.sum() > 100


def test_tracks_are_of_images_whose_projections_agree_with_their_pixels(colmap, pycolmap):
    found = pycolmap.Reconstruction(colmap / "sparse" / "0")
    assert len(found.points3D) > 1000
    errors_px, lengths = [], []
    for number, point in list(found.points3D.items())[::17]:
        lengths.append(point.track.length())
        for element in point.track.elements:
            image = found.images[element.image_id]
            assert image.points2D[element.point2D_idx].point3D_id == number
            projected = image.project_point(point.xyz)
            assert projected is not None
            errors_px.append(np.abs(projected - image.points2D[element.point2D_idx].xy).max())
    assert max(errors_px) < 1e-3
    assert np.mean(lengths) > 3.0


@pytest.fixture(scope="module")
def binary_files(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("binary") / "out"
    list(export_run(run, "colmap-binary", folder))
    return folder


def test_text_and_binary_files_are_the_same_reconstruction(colmap, pycolmap, binary_files):
    text = pycolmap.Reconstruction(colmap / "sparse" / "0")
    binary = pycolmap.Reconstruction(binary_files / "sparse" / "0")
    assert {path.suffix for path in (binary_files / "sparse" / "0").iterdir()} == {".bin"}
    assert text.summary() == binary.summary()
    for number, camera in text.cameras.items():
        assert camera.model == binary.cameras[number].model
        np.testing.assert_array_equal(camera.params, binary.cameras[number].params)
    for number, image in text.images.items():
        other = binary.images[number]
        assert (image.name, image.camera_id) == (other.name, other.camera_id)
        pose, other_pose = image.cam_from_world().matrix(), other.cam_from_world().matrix()
        np.testing.assert_allclose(pose, other_pose, atol=1e-15)
    for number, point in text.points3D.items():
        np.testing.assert_array_equal(point.xyz, binary.points3D[number].xyz)
        np.testing.assert_array_equal(point.color, binary.points3D[number].color)


def test_all_cameras_are_on_one_rig_that_moves(colmap, pycolmap, run, binary_files):
    for folder in (colmap, binary_files):
        found = pycolmap.Reconstruction(folder / "sparse" / "0")
        (rig,) = found.rigs.values()
        assert rig.num_sensors() == 3
        assert rig.ref_sensor_id.id == 1
        assert len(found.frames) == 4
        for frame in found.frames.values():
            images = [found.images[data.id] for data in frame.data_ids]
            assert {image.frame_id for image in images} == {frame.frame_id}
            assert len({image.name.partition("/")[2] for image in images}) == 1
        recording = Recording.read(run)
        for image in found.images.values():
            (camera,) = [one for one in recording.cameras if image.name.startswith(one.name)]
            step = int(image.name[-10:-4])
            pose = recording.truth.world_from_base[step] @ camera.mount.base_from_optical
            np.testing.assert_allclose(image.projection_center(), pose[:3, 3], atol=1e-12)


def test_masks_leave_out_what_colmap_cannot_project(colmap):
    mask = read_image(colmap / "masks" / "mirror.png")[0][..., 0]
    assert set(np.unique(mask)) == {0, 255}
    assert mask[24, 24] == 255
    assert mask[0, 0] == 0
    assert not (colmap / "masks" / "front.png").exists()
    assert (colmap / "masks" / "fisheye.png").exists()


def test_a_run_without_ranges_has_poses_and_no_points(run, tmp_path, pycolmap):
    shutil.copytree(run, tmp_path / "run")
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    manifest["channels"] = []
    (tmp_path / "run" / "manifest.json").write_text(json.dumps(manifest))
    notes = []
    list(export_run(tmp_path / "run", "colmap", tmp_path / "out", None, "front", notes.append))
    assert any(note.startswith("no points: they come from ranges") for note in notes)
    found = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert (len(found.images), len(found.points3D)) == (4, 0)
