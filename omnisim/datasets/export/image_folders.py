"""Folders of images and masks, one per camera, for structure from motion."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from omnisim.core.files.image_files import write_numbers
from omnisim.datasets.export.export_format import PrintNote
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording

IMAGES, MASKS = "images", "masks"


def image_name(camera: LensCamera, step: int) -> str:
    """Path of an image, relative to `IMAGES`."""
    return f"{camera.name}/{step:06d}.png"


def mask_name(camera: LensCamera) -> str:
    """Path of the mask of a camera's images, relative to `MASKS`."""
    return f"{camera.name}.png"


def write_images(
    recording: Recording, cameras: list[LensCamera], folder: Path, front_only: bool = False
) -> Iterator[int]:
    """Write masks and images; yield the number of finished steps after each.

    A mask is 255 where the image shows the scene, else 0; a camera without invalid pixels has none.

    Args:
        recording: run to export.
        cameras: cameras of the images.
        folder: folder of the export.
        front_only: True: also mask pixels at and past 90° from the lens's axis, except in
            panoramas.

    Raises:
        OmnisimError: a file cannot be read or written.
    """
    for camera in cameras:
        (folder / IMAGES / camera.name).mkdir(parents=True)
        mask = camera.mask(front_only and not camera.is_panorama)
        if mask is not None:
            (folder / MASKS).mkdir(exist_ok=True)
            values = np.where(mask, 255, 0).astype(np.uint8)
            write_numbers(folder / MASKS / mask_name(camera), values)
    for step in range(recording.steps):
        for camera in cameras:
            camera.copy_image(step, folder / IMAGES / image_name(camera, step))
        yield step + 1


def note_missing_ranges(cameras: list[LensCamera], contents: str, print_note: PrintNote) -> None:
    """Print a note that `contents` are missing, if no camera recorded ranges."""
    if not any(camera.recorded.has("range") for camera in cameras):
        print_note(f"no {contents}: they come from ranges, which --also range records")
