"""COLMAP finds the poses of an exported fisheye from the images alone."""

import subprocess
import sys

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.datasets.export.export import export_run

LENS = """
[lens]
model = "kannala_brandt"
width_px = 640
height_px = 640
focal_lengths_px = [230.0, 230.0]
principal_point_px = [319.5, 319.5]
coefficients = [0.01, -0.002, 0.0, 0.0]
theta_max_deg = 80.0
"""
IMAGES = 17


def _path():
    """An S of 4.3 m across the court, looking north."""
    t = np.linspace(0.0, 1.0, IMAGES)
    positions = np.stack(
        (-2.0 + 3.92 * t, 0.35 * np.sin(2 * np.pi * t) - 0.5, 1.3 + 0.1 * np.sin(3 * np.pi * t)), -1
    )
    yaws_deg = 90.0 + 25.0 * np.sin(2 * np.pi * t + 0.5)
    poses = [pose(at, yaw_deg=yaw) for at, yaw in zip(positions, yaws_deg, strict=True)]
    return Trajectory(4.0 * t, np.array(poses))


def _reconstruct(pycolmap, export, work):
    """Reconstruction from images, masks and the lens, whose poses nobody tells."""
    (camera,) = pycolmap.Reconstruction(export / "sparse" / "0").cameras.values()
    pycolmap.set_random_seed(0)
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = camera.model.name
    reader.camera_params = ",".join(map(repr, camera.params.tolist()))
    reader.camera_mask_path = str(export / "masks" / "camera.png")
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.use_gpu, extraction.num_threads = False, 2
    extraction.sift.max_num_features = 3000
    database = work / "database.db"
    pycolmap.extract_features(
        database,
        export / "images",
        camera_mode=pycolmap.CameraMode.SINGLE,
        reader_options=reader,
        extraction_options=extraction,
        device=pycolmap.Device.cpu,
    )
    matching = pycolmap.FeatureMatchingOptions()
    matching.use_gpu, matching.num_threads = False, 2
    pairing = pycolmap.SequentialPairingOptions()
    pairing.overlap, pairing.quadratic_overlap = 6, False
    pycolmap.match_sequential(
        database, matching_options=matching, pairing_options=pairing, device=pycolmap.Device.cpu
    )
    mapping = pycolmap.IncrementalPipelineOptions()
    mapping.num_threads = 2
    mapping.ba_refine_focal_length = mapping.ba_refine_principal_point = False
    mapping.ba_refine_extra_params = False
    found = pycolmap.incremental_mapping(database, export / "images", work / "out", options=mapping)
    return max(found.values(), key=lambda one: one.num_reg_images())


def _aligned(found, true):
    """Points (n, 3) moved to others by the nearest similarity. Source: Umeyama (1991)."""
    found_mean, true_mean = found.mean(axis=0), true.mean(axis=0)
    u, scales, vt = np.linalg.svd((true - true_mean).T @ (found - found_mean))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    scale = np.sum(scales * signs) / np.sum((found - found_mean) ** 2)
    return scale * (found - found_mean) @ (u * signs @ vt).T + true_mean


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.usefixtures("needs_opengl")
def test_poses_are_found_from_the_images_to_5_mm(tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    (tmp_path / "lens.toml").write_text(LENS)
    write_trajectory(tmp_path / "path.tum", _path())
    command = (
        "record courtyard --trajectory path.tum --trajectory-frame body --sensor lens.toml -o run"
    )
    subprocess.run([sys.executable, "-m", "omnisim", *command.split()], cwd=tmp_path, check=True)
    list(export_run(tmp_path / "run", "colmap", tmp_path / "colmap"))
    (tmp_path / "work").mkdir()
    found = _reconstruct(pycolmap, tmp_path / "colmap", tmp_path / "work")
    true = pycolmap.Reconstruction(tmp_path / "colmap" / "sparse" / "0")
    names = [image.name for image in true.images.values()]
    assert sorted(image.name for image in found.images.values()) == sorted(names)
    centers = [
        np.array([one.find_image_with_name(name).projection_center() for name in names])
        for one in (found, true)
    ]
    errors_m = np.linalg.norm(_aligned(*centers) - centers[1], axis=-1)
    rms_mm = 1e3 * np.sqrt(np.mean(errors_m**2))
    print(f"{len(names)} images, positions {rms_mm:.2f} mm RMS, {1e3 * errors_m.max():.2f} mm")
    assert rms_mm < 5.0
