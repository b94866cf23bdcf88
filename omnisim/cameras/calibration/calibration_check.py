"""Check of a calibration: findings on its cameras and their rig, and its lenses in other formats.

A finding states a number. It is unusual if 95 % of the catalog's cameras are nearer to the usual
value, or if a rig looks wrong; it is wrong if the numbers contradict each other.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera, CylindricalCamera, EquirectangularCamera, EucmCamera
from omnisim.cameras.calibration.calibrated_camera import (
    CalibratedCamera,
    Residuals,
    pose_contradiction,
)
from omnisim.cameras.calibration.calibration import Calibration, Rig, RigCamera
from omnisim.cameras.calibration.calibration_formats import FORMATS
from omnisim.cameras.calibration.encode import caveats, encode
from omnisim.cameras.calibration.fit import fitted_to_samples, samples_of
from omnisim.cameras.calibration.metadata import camera_from_lens, is_catadioptric
from omnisim.cameras.models import field_of_view as fields
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import CalibrationError, OmnisimError
from omnisim.core.poses import inverse, rotation_angles
from omnisim.core.short_repr import number_text

OK, UNUSUAL, WRONG = "ok", "unusual", "wrong"
# 95 % of the catalog's cameras are within these: of all, and of 250 for the distances from a fit.
MAX_OFFSET, MAX_ASPECT = 0.12, 0.025  # shares of the image's side, and of the focal length
MAX_INNER, MAX_RIM = 0.017, 0.085  # shares of the image's shorter side
MAX_SKEW_DEG, MAX_SHIFT_S = 0.1, 0.1  # pixels are rectangular to less; clocks differ by less
MAX_ROUND_TRIP_PX = 1e-3  # far above rounding, far below any accuracy of corners
MIN_COVERED = 0.1  # share of the image; a lens does not show less
REACH = 0.9  # of the way to the edge: there a square and its margin still fit
MIN_BASELINE_M, MAX_BASELINE_M = 1e-3, 10.0  # others are in other units
MAX_PAIR_RAD = math.radians(60.0)  # between axes of cameras that are left and right of each other
MAX_ALL_PAIRS = 6  # cameras; of more, only neighbors in the file are paired
GRID = 33


class Finding(NamedTuple):
    """One line of the check."""

    status: str  # OK, UNUSUAL or WRONG
    subject: str
    text: str  # with a number
    remedy: str = ""


class OtherFormats(NamedTuple):
    """A camera in other formats: exactly, fitted, or not at all."""

    formats: list[str]  # names of those in which it is the same
    camera: CentralCamera | None  # None: they cannot hold it
    model: str = ""  # its model there
    residuals: Residuals | None = None  # None: it is exact
    note: str = ""  # reason, or what the formats' own tools do with it

    @property
    def is_exact(self) -> bool:
        """True if the rays are the same."""
        return self.camera is not None and self.residuals is None


def _finding(subject: str, text: str, remedy: str, is_unusual: bool) -> Finding:
    return Finding(UNUSUAL, subject, text, remedy) if is_unusual else Finding(OK, subject, text)


def check_camera(calibrated: CalibratedCamera) -> list[Finding]:
    """Findings on a camera: field of view, limit, axis, pixels, rim, inverse, notes of the file."""
    camera = calibrated.camera
    findings = [*_view(camera)]
    if not isinstance(camera, CylindricalCamera | EquirectangularCamera):
        findings += [*_pixels(camera), *_rim(camera)]
    pixels = pixels_over(camera, GRID)
    rays = camera.ray_from_pixel(pixels)
    seen = camera.pixel_from_ray(rays.directions)
    errors_px = np.linalg.norm(seen.positions_px - pixels, axis=-1)[rays.valid & seen.valid]
    most_px = float(errors_px.max(initial=0.0))
    text = f"pixel to ray and back: at most {number_text(most_px, 2)} px off"
    is_wrong, remedy = (
        most_px > MAX_ROUND_TRIP_PX,
        "two directions of it share a pixel: calibrate again",
    )
    findings.append(Finding(WRONG if is_wrong else OK, "inverse", text, remedy if is_wrong else ""))
    known = fields.field_notes(camera)
    for note in (note for note in calibrated.notes if note not in known):
        is_wrong = note.startswith("the inverse polynomial")
        remedy = "convert it with --to ocamcalib, which writes a fitting one" if is_wrong else ""
        findings.append(Finding(WRONG if is_wrong else UNUSUAL, "file", note, remedy))
    if shift_s := calibrated.time_shift_s:
        text, is_far = f"{number_text(1e3 * shift_s, 4)} ms to the IMU", abs(shift_s) > MAX_SHIFT_S
        findings.append(_finding("time shift", text, "is it in milliseconds?", is_far))
    return findings


def _view(camera: CentralCamera) -> Iterator[Finding]:
    """Field of view, and where the model ends."""
    seen = fields.field_of_view(camera)
    left, right, up, down, *corners = map(math.degrees, fields.sweeps(camera))
    text = (
        f"{left + right:.1f}° × {up + down:.1f}°: left {left:.1f}°, right {right:.1f}°, up "
        f"{up:.1f}°, down {down:.1f}°, corners {min(corners):.1f}° to {max(corners):.1f}°"
    )
    yield Finding(OK if seen.covered else WRONG, "field of view", text)
    if seen.theta_limit_rad > math.pi - fields.THETA_TOLERANCE_RAD:
        yield Finding(OK, "limit", "none: all directions up to 180° have a pixel")
        return
    is_fold = fields.is_fold(camera, seen.theta_limit_rad)
    text = f"{'folds' if is_fold else 'ends'} at {math.degrees(seen.theta_limit_rad):.1f}°"
    if 1.0 - seen.covered < fields.MIN_UNSEEN:
        widest = f"the image at {math.degrees(seen.theta_max_rad):.1f}°"
        yield Finding(OK, "limit", f"{text}, {widest}")
        return
    text += f", inside the image: {100.0 * (1.0 - seen.covered):.0f} % of it is black"
    remedy = "mask the image beyond it, or calibrate again with corners near the rim"
    if seen.covered < MIN_COVERED:
        yield Finding(WRONG, "limit", text, "no lens shows so little: check its coefficients")
    else:
        yield _finding("limit", text, remedy, is_fold)


def _pixels(camera: CentralCamera) -> Iterator[Finding]:
    """Principal point, and ratio and angle of the pixel's sides, from the rays at this point."""
    center, size = np.asarray(camera.principal_point_px), (camera.width_px, camera.height_px)
    offset = center - 0.5 * (np.array(size) - 1.0)
    share = float(np.abs(offset / size).max())
    u, v = (number_text(value, 4, 2) for value in offset)
    text = f"({u}, {v}) px from the middle, {100.0 * share:.1f} % of the image"
    width, height = np.rint(2.0 * center + 1.0).astype(int)
    remedy = f"it is the middle of {width} × {height} px: were the images cropped or scaled?"
    yield _finding("principal point", text, remedy, share > MAX_OFFSET)
    rays = camera.ray_from_pixel(center + [[0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
    if not rays.valid.all():
        return
    tangents = rays.directions[:, :2] / np.abs(rays.directions[:, 2:])
    (fx, skew), (_, fy) = np.linalg.inv((tangents[::2] - tangents[1::2]).T).tolist()
    aspect, ratio = abs(fx / fy), size[0] / size[1]
    remedy = "are the images stretched (anamorphic), or their sides exchanged?"
    if min(abs(aspect * ratio - 1.0), abs(aspect / ratio - 1.0)) < MAX_ASPECT:
        remedy = "the focal lengths look as if they were shares of width and height"
    yield _finding("aspect", f"fx/fy = {aspect:.4f}", remedy, abs(aspect - 1.0) > MAX_ASPECT)
    skew_deg, remedy = math.degrees(math.atan2(skew, fx)), "sensors have none: calibrate without it"
    text = f"{number_text(skew_deg, 3, 3)}° from a right angle"
    yield _finding("skew", text, remedy, abs(skew_deg) > MAX_SKEW_DEG)


def _rim(camera: CentralCamera) -> Iterator[Finding]:
    """Distance at the rim from a smooth lens (EUCM) through what a board's corners can reach."""
    samples = samples_of(camera, is_catadioptric(camera))
    reached = is_reached(camera, samples.pixels_px)
    try:
        with np.errstate(all="ignore"):
            smooth, _ = fitted_to_samples(camera, EucmCamera, samples.subset(reached), {}, None)
    except OmnisimError:  # too few samples, or a lens unlike all others
        return
    seen = smooth.pixel_from_ray(samples.directions)
    distances_px = np.linalg.norm(seen.positions_px - samples.pixels_px, axis=-1)
    inner_px, rim_px = (
        float(distances_px[group & seen.valid].max(initial=0.0)) for group in (reached, ~reached)
    )
    reach_deg = math.degrees(float(samples.theta_rad[reached].max(initial=0.0)))
    text = (
        f"{pixels_text(inner_px)} from a smooth lens (EUCM) up to {reach_deg:.1f}°, as far as "
        f"corners of a board reach; {pixels_text(rim_px)} beyond"
    )
    side_px = min(camera.width_px, camera.height_px)
    is_far = inner_px > MAX_INNER * side_px
    remedy = "the rim is extrapolated: calibrate with the board at edges and corners"
    if is_far:
        remedy = "its distortion is not smooth: check the coefficients, or calibrate with fewer"
    yield _finding("rim", text, remedy, is_far or rim_px > MAX_RIM * side_px)


def pixels_text(value_px: float) -> str:
    """Distance with its unit: two significant digits, at least whole pixels."""
    return f"{value_px:.0f} px" if value_px >= 10.0 else f"{number_text(value_px, 2)} px"


def is_reached(camera: CentralCamera, pixels_px: Floats) -> Bools:
    """Mask (n,) of the pixels (n, 2) at which a board's corners can be: not close to the edge."""
    center = np.asarray(camera.principal_point_px)
    beyond = center + (pixels_px - center) / REACH
    last = np.array([camera.width_px, camera.height_px]) - 0.5
    inside: Bools = ((beyond > -0.5) & (beyond < last)).all(axis=-1)
    return inside & camera.ray_from_pixel(beyond).valid


def pixels_over(camera: CentralCamera, count: int) -> Floats:
    """Pixels (count², 2) evenly over an image, its border included."""
    sides = (np.linspace(-0.5, side - 0.5, count) for side in (camera.width_px, camera.height_px))
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)


def other_formats(calibrated: CalibratedCamera) -> list[OtherFormats]:
    """A camera in all formats: exact ones first, then by residual, then those that cannot."""
    found: list[OtherFormats] = []
    for name, form in FORMATS.items():
        try:
            with np.errstate(all="ignore"):  # at the edge of a fitted lens
                encoded = encode(calibrated, form, name)
                note = _shortened("; ".join(caveats(encoded.lens, form)), name)
        except CalibrationError as reason:
            found.append(OtherFormats([name], None, note=_shortened(str(reason), name)))
            continue
        residuals = None if encoded.residuals is calibrated.residuals else encoded.residuals
        camera = camera_from_lens(encoded.lens, encoded.metadata)
        found.append(OtherFormats([name], camera, encoded.lens.model_name, residuals, note))

    def rank(entry: OtherFormats) -> tuple[bool, float, str, str]:
        most_px = entry.residuals.max_px if entry.residuals else 0.0
        return entry.camera is None, most_px, entry.model, entry.note

    groups = [list(group) for _, group in itertools.groupby(sorted(found, key=rank), key=rank)]
    return [group[0]._replace(formats=[entry.formats[0] for entry in group]) for group in groups]


def _shortened(reason: str, name: str) -> str:
    """Reason of a format without its name, the camera's model and its field of view."""
    reason = re.sub(rf"^{name}: ({name} cannot represent model '\w+': )?", "", reason)
    reason = re.sub(r"model '\w+' cannot be fitted by (\w+: )", r"\1", reason)
    return re.sub(rf"sees up to [\d.]+° from its axis: ({name} )?", "", reason)


def check_rig(calibration: Calibration) -> list[Finding]:
    """Findings on the whole file: its notes, and the poses of its cameras.

    They are about contradictions, baselines, left and right, and inverted poses.
    """
    poses = [pose for camera in calibration.cameras for pose in camera.poses]
    contradiction = pose_contradiction(poses)
    notes = (note for note in calibration.file_notes if note != contradiction)
    findings = [Finding(UNUSUAL, "file", note) for note in notes]
    if contradiction is not None:
        remedy = "remove one of the two, or calibrate again"
        return [*findings, Finding(WRONG, "poses", contradiction, remedy)]
    if len(calibration.cameras) < 2:
        return findings
    try:
        rig = Rig.of(calibration)
    except CalibrationError as reason:
        name = str(reason).removeprefix(f"{calibration.source}: ").partition(":")[0]
        return [*findings, Finding(OK, "poses", f"no rig: {name} has no pose on a body")]
    is_small = len(rig.cameras) <= MAX_ALL_PAIRS
    pairs = itertools.combinations(rig.cameras, 2) if is_small else itertools.pairwise(rig.cameras)
    findings += [_pair(first, second, len(rig.cameras) == 2) for first, second in pairs]
    stated = np.stack([camera.body_from_camera for camera in rig.cameras])
    axes = np.array([fields.optical_axis(camera.model) for camera in rig.cameras])
    outward_m, inverted_m = (
        _outward_m(poses, axes) for poses in (stated, np.stack([*map(inverse, stated)]))
    )
    if inverted_m > MIN_BASELINE_M and outward_m < 0.5 * inverted_m:
        text, then = (f"{number_text(1e3 * mean_m, 4, 3)} mm" for mean_m in (outward_m, inverted_m))
        text = f"the cameras are {text} out from their middle, in the direction of their axes"
        remedy = f"suspicion: it is {then} with inverted poses: are they the wrong way round?"
        findings.append(Finding(UNUSUAL, "poses", text, remedy))
    return findings


def _pair(first: RigCamera, second: RigCamera, is_stereo: bool) -> Finding:
    """Finding on two cameras of a rig; a stereo pair's first camera usually is the left one."""
    pose = inverse(first.body_from_camera) @ second.body_from_camera  # first from second
    cosine = float(pose[2, 2]) * np.prod(
        [fields.optical_axis(each.model) for each in (first, second)]
    )
    angle_rad = math.acos(max(-1.0, min(float(cosine), 1.0)))
    rays = first.model.ray_from_pixel(pixels_over(first.model, GRID))
    seen = second.model.pixel_from_ray(rays.directions[rays.valid] @ pose[:3, :3])
    last = np.array([second.model.width_px, second.model.height_px]) - 0.5
    inside = ((seen.positions_px >= -0.5) & (seen.positions_px <= last)).all(axis=-1) & seen.valid
    baseline_m, (x_m, y_m, z_m) = float(np.linalg.norm(pose[:3, 3])), pose[:3, 3].tolist()
    names, is_left = (first.name, second.name), _is_left(first.name.lower(), second.name.lower())
    text = (
        f"{number_text(1e3 * baseline_m, 4, 3)} mm and {math.degrees(angle_rad):.1f}° apart, "
        f"{100.0 * float(inside.mean()) if len(inside) else 0.0:.0f} % of the view shared"
    )
    remedy = ""
    if baseline_m > MAX_BASELINE_M:
        remedy = "poses are in meters: are these millimeters?"
    elif baseline_m < MIN_BASELINE_M:
        is_same = angle_rad < math.radians(1.0)
        remedy = "they are one camera twice, or lack their baseline" if is_same else ""
    elif angle_rad < MAX_PAIR_RAD and not is_catadioptric(first.model):
        right_m = -x_m if is_left is False else x_m  # of the right one, or of the second one
        if is_left is not None and abs(x_m) < max(abs(y_m), abs(z_m)):
            axis, value_m = ("down", y_m) if abs(y_m) > abs(z_m) else ("ahead", z_m)
            remedy = (
                f"the offset is {1e3 * value_m:.4g} mm {axis}: are these poses of optical frames?"
            )
        elif right_m < -0.5 * baseline_m and (is_stereo or is_left is not None):
            left, right = reversed(names) if is_left is False else names
            remedy = f"suspicion: {right} is left of {left}: exchanged, or an inverted pose?"
    return _finding(" – ".join(names), text, remedy, bool(remedy))


def _is_left(first: str, second: str) -> bool | None:
    """True if names say that the first camera is the left one of a pair; None: they do not."""
    pair = first.replace("left", "right"), second.replace("left", "right")
    return "left" in first if first != second and pair[0] == pair[1] else None


def _outward_m(poses: Floats, axes: Floats) -> float:
    """Mean offset of a ring's cameras from their middle along their axes; 0 if it is no ring."""
    offsets = poses[:, :3, 3] - poses[:, :3, 3].mean(axis=0)
    angles = np.abs(rotation_angles(poses[:1, :3, :3], poses[:, :3, :3]))
    along_m = (poses[:, :3, 2] * axes[:, None] * offsets).sum(axis=1)
    is_ring = len(poses) > 2 and angles.max() > MAX_PAIR_RAD and abs(along_m.mean()) > along_m.std()
    return float(along_m.mean()) if is_ring else 0.0
