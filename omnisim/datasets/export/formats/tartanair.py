"""TartanAir V2: images of one camera, depths, classes, flow, poses in NED.

    P000/image_lcam_front/000000_lcam_front.png
    P000/depth_lcam_front/000000_lcam_front_depth.png   float32 in the four bytes of a pixel
    P000/seg_lcam_front/000000_lcam_front_seg.png       number of the class
    P000/flow_lcam_front/000000_000001_flow.png         u, v and mask, 16 bits each
    P000/pose_lcam_front.txt                            x y z qx qy qz qw
    P000/calibration.json, labels.json                  omnisim's: the data set's lens differs

A pinhole is `lcam_front`, with depths along the axis; a fisheye is `lcam_fish`, a panorama
`lcam_equirect`, with ranges as depths. The depth without a hit is 10 000 m. Poses are in NED
(x north, y east, z down), of a camera with axes x forward, y right, z down; north is the world's x.

Flow (u, v) in px is stored as 32768 + 64 u and 32768 + 64 v, in the order in which OpenCV reads the
channels. The mask is 0 if the point is visible in the next image, 1 if it is hidden, 100 if it is
outside the image or the ray hits nothing, and 200 if u or v is about 512 px or more.

Source: tartanair.org, "Modalities"; tartanairpy: reader.py, customizer.py, flow16to32.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bytes
from omnisim.core.files.image_files import write_numbers
from omnisim.core.poses import quaternion_from_rotation
from omnisim.datasets.export.export_format import ExportSettings, OneCameraFormat, PrintNote
from omnisim.datasets.export.formats.tum import write_lines
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.runs.run_folder import LABELS

FAR_M = 10_000.0
FLOW_ZERO, FLOW_PER_PX = 32768.0, 64.0
HIDDEN, OUTSIDE, TOO_LONG = 1, 100, 200  # in the flow masks
NED_FROM_WORLD = np.diag([1.0, -1.0, -1.0, 1.0])
# The NED camera's x is the lens's z, its y the lens's x, its z the lens's y.
LENS_FROM_NED = np.array(
    [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)


class Tartanair(OneCameraFormat):
    """TartanAir V2 trajectory."""

    name = "tartanair"
    channels = ("range", "semantic", "flow", "occluded")
    dates_stamps = False

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the trajectory, image by image."""
        camera = LensCamera.of(recording.cameras[0], print_note)
        name = "lcam_equirect" if camera.is_panorama else "lcam_fish"
        if camera.is_pinhole:
            name = "lcam_front"
        root = folder / "P000"
        kinds = [kind for kind, channel in (("depth", "range"), ("seg", "semantic"))
                 if camera.recorded.has(channel)]  # fmt: skip
        has_flow = camera.recorded.has("flow")
        for kind in ("image", *kinds, *(["flow"] if has_flow else [])):
            (root / f"{kind}_{name}").mkdir(parents=True)
        poses = NED_FROM_WORLD @ recording.truth.world_from_base @ camera.base_from_lens
        poses = poses @ LENS_FROM_NED
        rows = np.column_stack((poses[:, :3, 3], quaternion_from_rotation(poses[:, :3, :3])))
        lines = (" ".join(f"{value:.9f}" for value in row) for row in rows)
        write_lines(root / f"pose_{name}.txt", lines)
        camera.save_calibration(root / "calibration.json")
        if "seg" in kinds:
            shutil.copyfile(recording.run.path / LABELS, root / LABELS)
        for step in range(recording.steps):
            camera.copy_image(step, root / f"image_{name}" / f"{step:06d}_{name}.png")
            for kind in kinds:
                path = root / f"{kind}_{name}" / f"{step:06d}_{name}_{kind}.png"
                if kind == "depth":
                    write_numbers(path, _depths(camera, step))
                else:  # in 8 bits as in the data set, or in 16 if an ID exceeds 255
                    classes = camera.flip(camera.recorded.channel(step, "semantic"))
                    fits = classes.max(initial=0) < 256
                    write_numbers(path, classes.astype(np.uint8 if fits else np.uint16))
            if has_flow and step + 1 < recording.steps:
                path = root / f"flow_{name}" / f"{step:06d}_{step + 1:06d}_flow.png"
                write_numbers(path, _flow(camera, step))
            yield step + 1


def _depths(camera: LensCamera, step: int) -> Bytes:
    """Bytes (height, width, 4) of float32 depths, in the order that OpenCV reads as BGRA."""
    if camera.is_pinhole:
        depths_m = camera.depths_m(step)
    else:
        depths_m = camera.flip(camera.recorded.channel(step, "range"))
    depths_m = np.where(np.isfinite(depths_m), depths_m, FAR_M).astype("<f4")
    return depths_m.view(np.uint8).reshape(*depths_m.shape, 4)[..., (2, 1, 0, 3)]


def _flow(camera: LensCamera, step: int) -> NDArray[np.uint16]:
    """Mask, v and u (height, width, 3), which OpenCV reads in reverse order."""
    flow_px = camera.flip(camera.recorded.channel(step, "flow"))
    if camera.is_flipped:
        flow_px = flow_px * (-1.0, 1.0)
    occluded = camera.flip(camera.recorded.channel(step, "occluded"))
    steps = np.round(np.where(np.isfinite(flow_px), flow_px, 0.0) * FLOW_PER_PX + FLOW_ZERO)
    levels = np.iinfo(np.uint16)
    mask = np.select([occluded == 0, occluded == 1], [0, HIDDEN], OUTSIDE)
    mask[~np.isfinite(flow_px).all(axis=-1)] = OUTSIDE
    mask[((steps < levels.min) | (steps > levels.max)).any(axis=-1)] = TOO_LONG
    u, v = np.moveaxis(np.clip(steps, levels.min, levels.max), -1, 0)
    return np.stack((mask, v, u), axis=-1).astype(np.uint16)
