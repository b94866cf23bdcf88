"""Nerfstudio data set: `transforms.json`, images, masks, depths of pinholes, points.

    transforms.json                 intrinsics and poses, OpenGL axes: x right, y up, z back
    images/<camera>/000000.png      images
    masks/<camera>.png              255: shows the scene; only for cameras with invalid pixels
    depths/<camera>/000000.png      along the axis in millimeters, 16 bits, 0: none; for pinholes
    points.ply                      points from the ranges, for initialization

The world is omnisim's: meters, z up. Source: nerfstudio's documentation, "Data conventions".
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras.calibration.formats.nerfstudio import OPENGL_FROM_OPENCV, intrinsics
from omnisim.cameras.calibration.formats.nerfstudio import Nerfstudio as NerfstudioCalibration
from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write, write_text
from omnisim.core.files.image_files import write_numbers
from omnisim.datasets.export.export_format import ExportFormat, ExportSettings, FarDepths, PrintNote
from omnisim.datasets.export.lens_camera import (
    IMAGES,
    MASKS,
    LensCamera,
    ScenePoints,
    image_name,
    mask_name,
    note_missing_ranges,
    sample_points,
    write_images,
)
from omnisim.datasets.export.recording import Recording

DEPTHS, POINTS = "depths", "points.ply"
STEPS_PER_M = 1000.0  # nerfstudio's default depth_unit_scale_factor is 1/1000


class NerfstudioExport(ExportFormat):
    """Nerfstudio data set."""

    name = "nerfstudio"
    dates_stamps = False
    channels = ("range",)

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the data set."""
        cameras = [LensCamera.of(camera, print_note) for camera in recording.cameras]
        form = NerfstudioCalibration()
        lenses = [intrinsics(camera.encode(form, print_note)) for camera in cameras]
        models = {lens["camera_model"] for lens in lenses}
        if len(models) > 1:
            raise OutputError(
                f"{recording.run.path}: nerfstudio expects one camera_model, got "
                f"{', '.join(sorted(models))}: --camera-name selects one camera"
            )
        note_missing_ranges(cameras, POINTS, print_note)
        document: dict[str, Any] = {"camera_model": lenses[0]["camera_model"]}
        shared = lenses[0] if all(lens == lenses[0] for lens in lenses) else {}
        document |= shared
        points = sample_points(recording, cameras)
        if len(points):
            document["ply_file_path"] = POINTS
            write_ply(folder / POINTS, points)
        deep = [camera for camera in cameras if camera.is_pinhole and camera.recorded.has("range")]
        document["frames"] = [
            frame | ({} if shared else lens)
            for camera, lens in zip(cameras, lenses, strict=True)
            for frame in _frames(recording, camera, camera in deep)
        ]
        write_text(folder / "transforms.json", json.dumps(document, indent=2) + "\n")
        depths = {camera: FarDepths(camera.name, STEPS_PER_M) for camera in deep}
        for camera in depths:
            (folder / DEPTHS / camera.name).mkdir(parents=True)
        for done in write_images(recording, cameras, folder):
            for camera, far in depths.items():
                path = folder / DEPTHS / image_name(camera, done - 1)
                write_numbers(path, far.encode(camera.depths_m(done - 1)))
            yield done
        for far in depths.values():
            far.note(print_note)


def _frames(recording: Recording, camera: LensCamera, has_depths: bool) -> Iterator[dict[str, Any]]:
    """Frames of a camera, without intrinsics."""
    has_mask = camera.mask() is not None
    for step, world_from_base in enumerate(recording.truth.world_from_base):
        name = image_name(camera, step)
        frame: dict[str, Any] = {"file_path": f"{IMAGES}/{name}"}
        if has_mask:
            frame["mask_path"] = f"{MASKS}/{mask_name(camera)}"
        if has_depths:
            frame["depth_file_path"] = f"{DEPTHS}/{name}"
        opengl = world_from_base @ camera.base_from_lens * OPENGL_FROM_OPENCV
        yield {**frame, "transform_matrix": (opengl + 0.0).tolist()}


# Colored points as a PLY file.


_FIELDS = {"x": "float", "y": "float", "z": "float", "red": "uchar", "green": "uchar",
           "blue": "uchar"}  # fmt: skip


def write_ply(path: Path, points: ScenePoints) -> None:
    """Write positions in meters and sRGB colors, binary; `OutputError` if it cannot be written.

    Source: Turk, The PLY Polygon File Format (1994).
    """
    types = {"float": "<f4", "uchar": "u1"}
    records = np.empty(len(points), dtype=[(name, types[kind]) for name, kind in _FIELDS.items()])
    for index, axis in enumerate("xyz"):
        records[axis] = points.positions_m[:, index]
    for index, color in enumerate(("red", "green", "blue")):
        records[color] = points.colors[:, index]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property {kind} {name}" for name, kind in _FIELDS.items()]
    text = "\n".join([*header, "end_header"]) + "\n"
    with atomic_write(path) as partial:
        partial.write_bytes(text.encode("ascii") + records.tobytes())
