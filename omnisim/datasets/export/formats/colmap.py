"""COLMAP reconstruction: cameras, images with poses, and points from the ranges.

    images/<camera>/000000.png              images
    masks/<camera>.png                      for `ImageReader.camera_mask_path`
    sparse/0/cameras, images, points3D      .txt or .bin
    sparse/0/rigs, frames                   all cameras on one rig; the first is the reference

The world is omnisim's: meters, z up. A point's track has the images whose ranges agree with the
point, at the point's exact projections. COLMAP projects nothing at or past 90° from a lens's axis:
masks and tracks leave out these directions.

Source: COLMAP's documentation (Output Format, Camera Models, Rigs); its reconstruction_io.cc.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from omnisim.cameras.calibration.formats.colmap import CENTER_PX, ColmapLens, parameters
from omnisim.cameras.calibration.formats.colmap import Colmap as ColmapCalibration
from omnisim.core.arrays import Floats
from omnisim.core.poses import inverse, quaternion_from_rotation
from omnisim.datasets.export.export_format import ExportFormat, ExportSettings, PrintNote
from omnisim.datasets.export.lens_camera import (
    LensCamera,
    Observations,
    ScenePoints,
    image_name,
    note_missing_ranges,
    observations,
    sample_points,
    write_images,
)
from omnisim.datasets.export.recording import Recording

# COLMAP's numbers of its models, by the names of `parameters`.
MODEL_IDS = {
    "PINHOLE": 1, "OPENCV": 4, "OPENCV_FISHEYE": 5, "FULL_OPENCV": 6, "EUCM": 16,
    "EQUIRECTANGULAR": 17,
}  # fmt: skip
Track = list[tuple[int, int]]  # images that see a point, and its index in each of them


class Image(NamedTuple):
    """Image of the reconstruction, and its visible points."""

    # id, camera_id: numbers of the image and of its camera, from 1
    id: int
    camera_id: int
    name: str  # path below the folder of images
    lens_from_world: Floats  # (4, 4) pose of the world in the lens's frame
    seen: Observations


class _Colmap(ExportFormat):
    """Base of the two COLMAP formats."""

    dates_stamps = False
    channels = ("range",)
    suffix: ClassVar[str]

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the reconstruction, then the images."""
        cameras = [LensCamera.of(camera, print_note) for camera in recording.cameras]
        lenses = [camera.encode(ColmapCalibration(), print_note) for camera in cameras]
        note_missing_ranges(cameras, "points", print_note)
        points = sample_points(recording, cameras)
        model = folder / "sparse" / "0"
        model.mkdir(parents=True)
        write, write_rig = _write_binary, _write_rig_binary
        if self.suffix == ".txt":
            write, write_rig = _write_text, _write_rig_text
        seen = observations(recording, cameras, points, front_only=True)
        shots = product(enumerate(recording.truth.world_from_base), enumerate(cameras, start=1))
        images = (
            Image(number, camera_id, image_name(camera, step),
                  inverse(world_from_base @ camera.base_from_lens), next(seen))
            for number, ((step, world_from_base), (camera_id, camera)) in enumerate(shots, start=1)
        )  # fmt: skip
        write(model, lenses, images, points)
        rig_from_world = inverse(recording.truth.world_from_base @ cameras[0].base_from_lens)
        lens_from_rig = [
            inverse(camera.base_from_lens) @ cameras[0].base_from_lens for camera in cameras
        ]
        write_rig(model, lens_from_rig, rig_from_world)
        yield from write_images(recording, cameras, folder, front_only=True)


class ColmapExport(_Colmap):
    """COLMAP reconstruction as text."""

    name = "colmap"
    suffix = ".txt"


class ColmapBinary(_Colmap):
    """COLMAP reconstruction in binary files."""

    name = "colmap-binary"
    suffix = ".bin"


def _write_text(
    folder: Path, lenses: list[ColmapLens], images: Iterator[Image], points: ScenePoints
) -> None:
    with (folder / "cameras.txt").open("w", encoding="utf-8") as file:
        file.write("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n")
        for camera_id, lens in enumerate(lenses, start=1):
            model, values = parameters(lens)
            numbers = " ".join(repr(float(value)) for value in values)
            file.write(f"{camera_id} {model} {lens.width_px} {lens.height_px} {numbers}\n")
    tracks: list[Track] = [[] for _ in range(len(points))]
    with (folder / "images.txt").open("w", encoding="utf-8") as file:
        file.write(
            "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as X Y POINT3D_ID\n"
        )
        for image in images:
            _extend(tracks, image)
            numbers = " ".join(map(repr, _pose_numbers(image.lens_from_world)))
            file.write(f"{image.id} {numbers} {image.camera_id} {image.name}\n")
            rows = zip((image.seen.pixels + CENTER_PX).tolist(), image.seen.points, strict=True)
            file.write(" ".join(f"{u:.6f} {v:.6f} {point + 1}" for (u, v), point in rows) + "\n")
    with (folder / "points3D.txt").open("w", encoding="utf-8") as file:
        file.write("# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n")
        for number, position, color, track in _seen_points(points, tracks):
            numbers = " ".join(map(repr, position))
            seen = " ".join(f"{image} {index}" for image, index in track)
            file.write(f"{number} {numbers} {' '.join(map(str, color))} 0 {seen}\n")


def _write_binary(
    folder: Path, lenses: list[ColmapLens], images: Iterator[Image], points: ScenePoints
) -> None:
    with (folder / "cameras.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(lenses)))
        for camera_id, lens in enumerate(lenses, start=1):
            model, values = parameters(lens)
            size = lens.width_px, lens.height_px
            file.write(struct.pack("<IiQQ", camera_id, MODEL_IDS[model], *size))
            file.write(struct.pack(f"<{len(values)}d", *values))
    tracks: list[Track] = [[] for _ in range(len(points))]
    with (folder / "images.bin").open("wb") as file:
        file.write(struct.pack("<Q", 0))
        count = 0
        for count, image in enumerate(images, start=1):  # noqa: B007
            _extend(tracks, image)
            pose = _pose_numbers(image.lens_from_world)
            file.write(struct.pack("<I7dI", image.id, *pose, image.camera_id))
            file.write(image.name.encode("utf-8") + b"\0")
            records = np.empty(len(image.seen.points), dtype=[("uv", "<f8", 2), ("point", "<u8")])
            records["uv"] = image.seen.pixels + CENTER_PX
            records["point"] = image.seen.points + 1
            file.write(struct.pack("<Q", len(records)) + records.tobytes())
        file.seek(0)
        file.write(struct.pack("<Q", count))
    with (folder / "points3D.bin").open("wb") as file:
        file.write(struct.pack("<Q", sum(map(bool, tracks))))
        for number, position, color, track in _seen_points(points, tracks):
            file.write(struct.pack("<Q3d3BdQ", number, *position, *color, 0.0, len(track)))
            file.write(np.array(track, dtype="<u4").tobytes())


def _seen_points(
    points: ScenePoints, tracks: list[Track]
) -> Iterator[tuple[int, list[float], list[int], Track]]:
    """Number, position, color and track of each point that an image sees."""
    rows = zip(points.positions_m.tolist(), points.colors.tolist(), tracks, strict=True)
    for number, (position, color, track) in enumerate(rows, start=1):
        if track:
            yield number, position, color, track


def _extend(tracks: list[Track], image: Image) -> None:
    for index, point in enumerate(image.seen.points.tolist()):
        tracks[point].append((image.id, index))


def _pose_numbers(pose: Floats) -> list[float]:
    """Quaternion, w first, and translation of a pose (4, 4)."""
    x, y, z, w = quaternion_from_rotation(pose[None, :3, :3])[0].tolist()
    return [w, x, y, z, *pose[:3, 3].tolist()]


# `rigs` and `frames`: all cameras are on one rig, whose frame is the first camera's. A frame is a
# step of the run; its images are numbered as in `images`, step by step, camera by camera.


RIG_ID, REFERENCE_ID, CAMERA_SENSOR = 1, 1, 0


def _write_rig_text(folder: Path, lens_from_rig: list[Floats], rig_from_world: Floats) -> None:
    """Write rigs.txt and frames.txt: poses (4, 4) of cameras, and (steps, 4, 4) of the world."""
    sensors = f"{RIG_ID} {len(lens_from_rig)} CAMERA {REFERENCE_ID}"
    for camera_id, pose in enumerate(lens_from_rig[1:], start=2):
        sensors += f" CAMERA {camera_id} 1 {' '.join(map(repr, _pose_numbers(pose)))}"
    with (folder / "rigs.txt").open("w", encoding="utf-8") as file:
        file.write(f"# RIG_ID NUM_SENSORS REF_SENSOR SENSORS[]\n{sensors}\n")
    with (folder / "frames.txt").open("w", encoding="utf-8") as file:
        file.write("# FRAME_ID RIG_ID RIG_FROM_WORLD NUM_DATA_IDS DATA_IDS[]\n")
        for step, pose in enumerate(rig_from_world):
            numbers = " ".join(map(repr, _pose_numbers(pose)))
            data = " ".join(
                f"CAMERA {camera} {image}" for camera, image in _rig_images(step, lens_from_rig)
            )
            file.write(f"{step + 1} {RIG_ID} {numbers} {len(lens_from_rig)} {data}\n")


def _write_rig_binary(folder: Path, lens_from_rig: list[Floats], rig_from_world: Floats) -> None:
    """Write rigs.bin and frames.bin; see `_write_rig_text`."""
    with (folder / "rigs.bin").open("wb") as file:
        file.write(struct.pack("<QII", 1, RIG_ID, len(lens_from_rig)))
        file.write(struct.pack("<iI", CAMERA_SENSOR, REFERENCE_ID))
        for camera_id, pose in enumerate(lens_from_rig[1:], start=2):
            file.write(struct.pack("<iIB7d", CAMERA_SENSOR, camera_id, 1, *_pose_numbers(pose)))
    with (folder / "frames.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(rig_from_world)))
        for step, pose in enumerate(rig_from_world):
            numbers = _pose_numbers(pose)
            file.write(struct.pack("<II7dI", step + 1, RIG_ID, *numbers, len(lens_from_rig)))
            for camera, image in _rig_images(step, lens_from_rig):
                file.write(struct.pack("<iIQ", CAMERA_SENSOR, camera, image))


def _rig_images(step: int, cameras: list[Floats]) -> list[tuple[int, int]]:
    """Numbers of the cameras and of their images at a step."""
    return [(camera, step * len(cameras) + camera) for camera in range(1, len(cameras) + 1)]
