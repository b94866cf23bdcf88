"""Cameras of a run as lenses, for the formats of other tools.

A catadioptric image is mirror-inverted; the image of a lens is not. Flipped left to right, it is
the image of a lens whose frame is the optical frame after a half turn. The channels of ground truth
are flipped, too; the points in space are the same.
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    CentralCamera,
    EllipticCamera,
    EquirectangularCamera,
    PerspectiveCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import CalibratedCamera, calibration_of, save_calibration
from omnisim.cameras.calibration.encode import caveats, encode
from omnisim.cameras.calibration.file_frame import is_catadioptric, lens_of
from omnisim.cameras.calibration.formats.format import Format, LensT
from omnisim.cameras.camera import pixel_grid
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import CalibrationError
from omnisim.core.files.image_files import write_image, write_numbers
from omnisim.datasets.export.export_format import PrintNote
from omnisim.datasets.export.recorded_camera import RecordedCamera
from omnisim.datasets.export.recording import Recording

LensCameraT = TypeVar("LensCameraT", bound=CentralCamera)
# Half turns from the frame of a flipped lens to the optical frame.
_ABOUT_X, _ABOUT_Y = np.diag([1.0, -1.0, -1.0, 1.0]), np.diag([-1.0, 1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class LensCamera:
    """Camera of a run as a lens.

    Attributes:
        recorded: camera of the run.
        model: central model of the camera.
    """

    recorded: RecordedCamera
    model: CentralCamera

    @classmethod
    def of(cls, recorded: RecordedCamera, print_note: PrintNote) -> LensCamera:
        """Convert a camera to a lens.

        Args:
            recorded: camera of the run.
            print_note: callback for a note if the images are flipped.

        Raises:
            RunError: the camera is non-central.
        """
        camera = cls(recorded, recorded.central)
        if camera.is_flipped:
            print_note(
                f"{recorded.name}: looks into a mirror: its images are flipped left to right, as "
                "a lens has them"
            )
        return camera

    @property
    def name(self) -> str:
        """Name of the camera."""
        return self.recorded.name

    @property
    def is_flipped(self) -> bool:
        """True if the run's images are mirror-inverted, as those of a catadioptric camera are."""
        return is_catadioptric(self.model)

    @property
    def base_from_lens(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the lens's frame: x right, y down, z forward."""
        return self.recorded.mount.base_from_optical @ self.optical_from_lens

    @cached_property
    def lens(self) -> CentralCamera:
        """Lens model of the exported images, flipped if they are, without the rim of a mirror.

        Raises:
            CalibrationError: the model does not support flipped images.
        """
        lens = lens_of(self.model)
        if not self.is_flipped or lens is None:
            return self.model
        return flipped_lens(lens, str(self.recorded.run.path / self.name))

    def save_calibration(self, path: Path) -> None:
        """Write the lens to an omnisim calibration file.

        Raises:
            OutputError: the file cannot be written.
        """
        save_calibration(calibration_of(self.lens, self.name), path, "omnisim")

    def encode(self, form: Format[LensT], print_note: PrintNote, model: str | None = None) -> LensT:
        """Lens in a model of a calibration format, exact or the best fit.

        Args:
            form: calibration format.
            print_note: callback for a note on the residual of a fit.
            model: name of the only allowed model; None: any.

        Raises:
            CalibrationError: no model of the format fits.
        """
        calibrated = CalibratedCamera(self.name, self.model)
        place = str(self.recorded.run.path / self.name)
        encoded = encode(calibrated, form, place, model)
        if (fit := encoded.residuals) is not None:
            print_note(
                f"{self.name}: {encoded.lens.model_name}, fitted to {fit.source_model}: RMS "
                f"{fit.rms_px:.3g} px, at most {fit.max_px:.3g} px"
            )
        for caveat in caveats(encoded.lens, form):
            print_note(f"{self.name}: {caveat}")
        return flipped_lens(encoded.lens, place) if self.is_flipped else encoded.lens

    def flip(self, values: NDArray[Any]) -> NDArray[Any]:
        """Array (height, width, …) of the image's pixels, flipped left to right if the image is."""
        return np.ascontiguousarray(values[:, ::-1]) if self.is_flipped else values

    def copy_image(self, step: int, target: Path) -> None:
        """Write the image of a step as a PNG file.

        Raises:
            OutputError: a file cannot be read or written.
        """
        image = self.recorded.image(step)  # fails for a damaged image, before anything is copied
        source = self.recorded.image_file(step)
        if self.is_flipped or source.suffix != target.suffix:
            write_image(target, self.flip(image))
        else:
            shutil.copyfile(source, target)

    @property
    def is_pinhole(self) -> bool:
        """True for a lens that projects to a plane, distorted or not."""
        lens = self.lens
        return isinstance(lens, PerspectiveCamera) or (
            isinstance(lens, UnifiedCamera) and lens.xi == 0.0
        )

    @property
    def is_panorama(self) -> bool:
        """True for an image of all directions."""
        return isinstance(self.model, EquirectangularCamera)

    def depths_m(self, step: int) -> NDArray[np.float32]:
        """Depths (height, width) along the lens's axis, from the channel range; +inf: no hit.

        Raises:
            OutputError: a file is missing or damaged.
        """
        ranges_m = self.recorded.channel(step, "range")
        along = self.recorded.directions @ self.axis
        hit = np.isfinite(ranges_m)
        depths = np.full(ranges_m.shape, np.inf, dtype=np.float32)
        depths[hit] = ranges_m[hit] * along[hit]
        return self.flip(depths)

    @property
    def optical_from_lens(self) -> NDArray[np.float64]:
        """Rotation (4, 4) from the lens's to the optical frame: the identity, or a half turn."""
        if not self.is_flipped:
            return np.eye(4)
        return _ABOUT_X if isinstance(self.model, EllipticCamera) else _ABOUT_Y

    def mask(self, front_only: bool = False) -> NDArray[np.bool_] | None:
        """Mask (height, width) of the pixels that show the scene; None: all pixels.

        Args:
            front_only: True: leave out rays at and past 90° from the axis.
        """
        shown = self.recorded.valid
        if (covered := self.recorded.mount.covered) is not None:
            shown = shown & covered
        if front_only:
            shown = shown & (self.recorded.directions @ self.axis > 0.0)
        return None if shown.all() else self.flip(shown)

    @property
    def axis(self) -> NDArray[np.float64]:
        """Unit vector (3,) along the lens's axis, in the optical frame."""
        return self.optical_from_lens[:3, 2]


def flipped_lens(lens: LensCameraT, place: str) -> LensCameraT:
    """Lens whose image is that of another lens, flipped left to right.

    Args:
        lens: lens to flip.
        place: name of the camera in messages.

    Raises:
        CalibrationError: the lens's model does not support flipped images.
    """
    if not isinstance(lens, ParametricCamera):
        raise CalibrationError(f"{place}: model {lens.model_name!r} has no flipped images")
    size = lens.width_px, lens.height_px
    changes: dict[str, Any] = {}
    if any(field.name == "principal_point_px" for field in dataclasses.fields(lens)):
        u, v = lens.principal_point_px
        changes["principal_point_px"] = (lens.width_px - 1 - u, v)
    if isinstance(lens, UnifiedCamera):
        k1, k2, p1, p2, *more = lens.distortion or (0.0, 0.0, 0.0, 0.0)
        changes["distortion"] = (k1, k2, p1, -p2 + 0.0, *more)
        changes["skew_px"] = -lens.skew_px + 0.0
    flipped = dataclasses.replace(lens, **changes)
    pixels = pixel_grid(*size)[:: max(1, size[1] // 32), :: max(1, size[0] // 32)]
    own = lens.ray_from_pixel(pixels)
    mirrored = flipped.ray_from_pixel(np.stack((size[0] - 1 - pixels[..., 0], pixels[..., 1]), -1))
    seen = own.valid & mirrored.valid
    same = np.abs(own.directions[seen] * (-1.0, 1.0, 1.0) - mirrored.directions[seen])
    if not np.array_equal(own.valid, mirrored.valid) or same.max(initial=0.0) > 1e-9:
        raise CalibrationError(f"{place}: model {lens.model_name!r} has no flipped images")
    return flipped


# Folders of images and masks, one per camera, for structure from motion.


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
