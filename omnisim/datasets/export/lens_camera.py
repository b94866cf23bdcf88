"""Cameras of a run as lenses, for the formats of other tools.

A catadioptric image is mirror-inverted; the image of a lens is not. Flipped left to right, it is
the image of a lens whose frame is the optical frame after a half turn. The channels of ground truth
are flipped, too; the points in space are the same. A file that cannot be read or written raises an
`OmnisimError`.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

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
from omnisim.cameras.calibration.formats.format import Format, LensT
from omnisim.cameras.calibration.metadata import is_catadioptric, lens_of
from omnisim.cameras.camera import pixel_grid
from omnisim.cameras.parametric_camera import ParametricCamera, SkewedCamera
from omnisim.core.arrays import Bools, Bytes, Floats, Floats32, Indices
from omnisim.core.errors import CalibrationError
from omnisim.core.files.image_files import write_image, write_numbers
from omnisim.core.poses import inverse
from omnisim.datasets.export.export_format import PrintNote
from omnisim.datasets.export.recording import RecordedCamera, Recording

LensCameraT = TypeVar("LensCameraT", bound=CentralCamera)
# Half turns from the frame of a flipped lens to the optical frame.
_ABOUT_X, _ABOUT_Y = np.diag([1.0, -1.0, -1.0, 1.0]), np.diag([-1.0, 1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class LensCamera:
    """Camera of a run as a lens, by the central model of the camera."""

    recorded: RecordedCamera
    model: CentralCamera

    @classmethod
    def of(cls, recorded: RecordedCamera, print_note: PrintNote) -> LensCamera:
        """Convert a camera to a lens; a note says if the images are flipped.

        Raises:
            RunError: the camera is non-central.
        """
        camera = cls(recorded, recorded.central)
        if camera.is_flipped:
            print_note(
                f"{recorded.name}: looks into a mirror: its images are flipped left to right, "
                "like those of a lens"
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
    def base_from_lens(self) -> Floats:
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
        """Write the lens to an omnisim calibration file."""
        save_calibration(calibration_of(self.lens, self.name), path, "omnisim")

    def encode(self, form: Format[LensT], print_note: PrintNote, model: str | None = None) -> LensT:
        """Lens in a model of a calibration format, exact or the best fit; a note states the error.

        A model's name makes it the only one allowed.

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
        """Write the image of a step as a PNG file."""
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

    def depths_m(self, step: int) -> Floats32:
        """Depths (height, width) along the lens's axis, from the channel range; +inf: no hit."""
        ranges_m = self.recorded.channel(step, "range")
        along = self.recorded.directions @ self.axis
        hit = np.isfinite(ranges_m)
        depths = np.full(ranges_m.shape, np.inf, dtype=np.float32)
        depths[hit] = ranges_m[hit] * along[hit]
        return self.flip(depths)

    @property
    def optical_from_lens(self) -> Floats:
        """Rotation (4, 4) from the lens's to the optical frame: the identity, or a half turn."""
        if not self.is_flipped:
            return np.eye(4)
        return _ABOUT_X if isinstance(self.model, EllipticCamera) else _ABOUT_Y

    def mask(self, front_only: bool = False) -> Bools | None:
        """Mask (height, width) of the pixels that show the scene; None: all pixels.

        `front_only` leaves out rays at and past 90° from the axis.
        """
        shown = self.recorded.valid
        if (covered := self.recorded.mount.covered) is not None:
            shown = shown & covered
        if front_only:
            shown = shown & (self.recorded.directions @ self.axis > 0.0)
        return None if shown.all() else self.flip(shown)

    @property
    def axis(self) -> Floats:
        """Unit vector (3,) along the lens's axis, in the optical frame."""
        return self.optical_from_lens[:3, 2]


def flipped_lens(lens: LensCameraT, place: str) -> LensCameraT:
    """Lens whose image is that of another lens, flipped left to right; `place` names the camera.

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
    if isinstance(lens, SkewedCamera):
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
    `front_only` also masks pixels at and past 90° from the lens's axis, except in panoramas.
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


# Points of the scene from the ranges of a run's images, with the images that see each point.
#
# Every k-th row and column of every image gives points. An image sees a point if the range of the
# pixel nearest to the point's projection equals the point's distance to 1 %. On surfaces that are
# not seen at grazing angles, the two differ by less; where an occluder hides the point, by more.


MAX_POINTS = 20_000
AGREEMENT = 0.01  # share of the range


class Observations(NamedTuple):
    """Points visible in an image: ascending indices (n,), and projections (n, 2) into it, px."""

    points: Indices
    pixels: Floats  # from the center of the first pixel, in the exported image


@dataclass(frozen=True, eq=False)
class ScenePoints:
    """Points of the scene: positions (n, 3) in the world, and colors (n, 3), sRGB."""

    positions_m: Floats
    colors: Bytes

    def __len__(self) -> int:
        return len(self.positions_m)


def sample_points(
    recording: Recording, cameras: list[LensCamera], max_points: int = MAX_POINTS
) -> ScenePoints:
    """About `max_points` points seen by evenly spaced pixels of all images; none without ranges."""
    ranged = [camera for camera in cameras if camera.recorded.has("range")]
    pixels = recording.steps * sum(math.prod(camera.recorded.size_px) for camera in ranged)
    step_px = max(1, math.ceil(math.sqrt(pixels / max_points)))
    positions: list[NDArray[Any]] = [np.zeros((0, 3))]
    colors: list[NDArray[Any]] = [np.zeros((0, 3), dtype=np.uint8)]
    for step in range(recording.steps):
        for camera in ranged:
            ranges_m = camera.recorded.channel(step, "range")
            chosen = np.full(ranges_m.shape, np.inf, dtype=ranges_m.dtype)
            spread = slice(step_px // 2, None, step_px)
            chosen[spread, spread] = ranges_m[spread, spread]
            points_m, hit = camera.recorded.points_m(chosen)
            base_from_optical = camera.recorded.mount.base_from_optical
            pose = recording.truth.world_from_base[step] @ base_from_optical
            positions.append(points_m @ pose[:3, :3].T + pose[:3, 3])
            colors.append(camera.recorded.image(step)[hit])
    return ScenePoints(np.concatenate(positions), np.concatenate(colors))


def observations(
    recording: Recording, cameras: list[LensCamera], points: ScenePoints, front_only: bool
) -> Iterator[Observations]:
    """Points visible in each image, step by step and camera by camera.

    `front_only` leaves out points at and past 90° from a lens's axis, except in panoramas.
    """
    for step, camera in itertools.product(range(recording.steps), cameras):
        if not camera.recorded.has("range"):
            yield Observations(np.zeros(0, dtype=np.intp), np.zeros((0, 2)))
            continue
        pose = recording.truth.world_from_base[step] @ camera.recorded.mount.base_from_optical
        optical_from_world = inverse(pose)
        local_m = points.positions_m @ optical_from_world[:3, :3].T + optical_from_world[:3, 3]
        distances_m = np.linalg.norm(local_m, axis=-1)
        projected = camera.model.pixel_from_ray(local_m)
        width, height = camera.recorded.size_px
        nearest = np.rint(np.where(projected.valid[:, None], projected.positions_px, -1.0))
        inside = projected.valid & np.all((nearest >= 0) & (nearest < (width, height)), axis=-1)
        if front_only and not camera.is_panorama:
            inside &= local_m @ camera.axis > 0.0
        seen = np.flatnonzero(inside)
        u, v = nearest[seen].astype(np.intp).T
        ranges_m = camera.recorded.channel(step, "range")[v, u]
        with np.errstate(invalid="ignore"):  # of missing hits
            agrees = np.abs(ranges_m - distances_m[seen]) <= AGREEMENT * distances_m[seen]
        seen = seen[agrees]
        pixels = projected.positions_px[seen]
        if camera.is_flipped:
            pixels = np.stack((width - 1 - pixels[:, 0], pixels[:, 1]), axis=-1)
        yield Observations(seen, pixels)
