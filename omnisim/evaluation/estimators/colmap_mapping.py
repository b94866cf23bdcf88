"""Structure from motion by COLMAP, from images and their calibration.

Source: Schönberger & Frahm, "Structure-from-motion revisited", CVPR 2016; package `pycolmap`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import EstimatorError
from omnisim.core.poses import inverse
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.export import for_format
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.datasets.export.export_formats import format_named
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import CameraTracker

if TYPE_CHECKING:
    import pycolmap

FEATURES = 3000  # per image
OVERLAP = 8  # following images that each image is matched with
MIN_IMAGES, MAX_IMAGES = 3, 40  # per camera; of a longer run, images at equal intervals are taken


class ColmapMapping(CameraTracker):
    """Incremental mapping with the sequence of the first camera's images."""

    title = "COLMAP (one camera)"
    package, module = "pycolmap", "pycolmap"
    all_cameras = False

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the tracked frame at the registered images of the largest model."""
        import pycolmap

        if not run.cameras:
            raise EstimatorError("the run has no camera")
        if self.all_cameras and len(run.cameras) < 2:
            raise EstimatorError("the run has one camera: expected a rig")
        if not self.all_cameras:
            run = Recording.read(run.run.path, run.cameras[0].name)
        form = format_named("colmap")
        taken = for_format(run, form, lambda note: None)
        taken = taken.every(-(-taken.steps // MAX_IMAGES))
        export = work / "export"
        export.mkdir()
        for _ in form.write(taken, export, ExportSettings(), lambda note: None):
            pass
        given = pycolmap.Reconstruction(export / "sparse" / "0")
        names = [camera.name for camera in taken.cameras]
        database = work / "database.db"
        pycolmap.set_random_seed(0)
        for number, name in enumerate(names, start=1):
            _extract(given.cameras[number], database, export, name)
        if len(names) > 1:
            _apply_rig(given, database, names)
        pairing = pycolmap.SequentialPairingOptions()
        pairing.overlap, pairing.quadratic_overlap = OVERLAP, False
        matching = pycolmap.FeatureMatchingOptions()
        matching.use_gpu = False
        cpu = pycolmap.Device.cpu
        pycolmap.match_sequential(
            database, matching_options=matching, pairing_options=pairing, device=cpu
        )
        mapping = pycolmap.IncrementalPipelineOptions()
        mapping.random_seed = 0
        mapping.ba_refine_focal_length = mapping.ba_refine_principal_point = False
        mapping.ba_refine_extra_params = mapping.ba_refine_sensor_from_rig = False
        models = pycolmap.incremental_mapping(
            database, export / "images", work / "models", options=mapping
        )
        return _trajectory(models, taken, self.tracked_from_base(taken))


class ColmapRigMapping(ColmapMapping):
    """Incremental mapping with a rig of all cameras with known extrinsics."""

    title = "COLMAP (rig)"
    alignment = "se3"
    all_cameras = True


def _extract(camera: pycolmap.Camera, database: Path, export: Path, name: str) -> None:
    """Extract the features of a camera's images, with its known calibration."""
    import pycolmap

    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = camera.model.name
    reader.camera_params = ",".join(map(repr, camera.params.tolist()))
    mask = export / "masks" / f"{name}.png"
    if mask.is_file():
        reader.camera_mask_path = str(mask)
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.use_gpu = False
    extraction.sift.max_num_features = FEATURES
    images = sorted((export / "images" / name).iterdir())
    pycolmap.extract_features(
        database, export / "images", image_names=[f"{name}/{path.name}" for path in images],
        camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reader,
        extraction_options=extraction, device=pycolmap.Device.cpu,
    )  # fmt: skip


def _apply_rig(given: pycolmap.Reconstruction, database: Path, names: list[str]) -> None:
    """Declare the cameras as a rig in the database; the first one is the reference."""
    import pycolmap

    (rig,) = given.rigs.values()
    cameras = [pycolmap.RigConfigCamera(ref_sensor=True, image_prefix=f"{names[0]}/")]
    for number, name in enumerate(names[1:], start=2):
        sensor = pycolmap.sensor_t(pycolmap.SensorType.CAMERA, number)
        pose = rig.sensor_from_rig(sensor)
        cameras.append(pycolmap.RigConfigCamera(image_prefix=f"{name}/", cam_from_rig=pose))
    with pycolmap.Database.open(database) as opened:
        pycolmap.apply_rig_config([pycolmap.RigConfig(cameras=cameras)], opened)


def _trajectory(
    models: dict[int, pycolmap.Reconstruction], taken: Recording, tracked_from_base: Floats
) -> Trajectory:
    """Poses of the tracked frame at the images of the first camera, in the largest model."""
    camera = taken.cameras[0]
    poses = {}
    if models:
        largest = max(models.values(), key=lambda model: int(model.num_reg_images()))
        base_from_lens = LensCamera.of(camera, lambda note: None).base_from_lens  # as exported
        lens_from_tracked = inverse(tracked_from_base @ base_from_lens)
        for image in largest.images.values():
            folder, _, file = image.name.partition("/")
            if folder == camera.name and image.has_pose:
                world_from_lens = np.eye(4)
                world_from_lens[:3] = image.cam_from_world().inverse().matrix()
                poses[int(Path(file).stem)] = world_from_lens @ lens_from_tracked
    if len(poses) < MIN_IMAGES:
        raise EstimatorError(f"{len(poses)} images in COLMAP's largest model")
    steps = sorted(poses)
    return Trajectory(taken.truth.times_s[steps], np.stack([poses[step] for step in steps]))
