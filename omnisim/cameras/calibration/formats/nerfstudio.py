"""Nerfstudio's transforms.json, with intrinsics for all frames or for each frame.

| camera_model | parameters | model |
| --- | --- | --- |
| PINHOLE, OPENCV (k4 = 0) | fl_x fl_y cx cy k1 k2 p1 p2 k3 | perspective, unified |
| OPENCV_FISHEYE, FISHEYE | fl_x fl_y cx cy k1 k2 k3 k4 | kannala_brandt |
| EQUIRECTANGULAR, instant-ngp's latlong | | equirectangular |
| instant-ngp's ftheta_p0 = 0, ftheta_p1 … ftheta_p4 | cx cy | f_theta_inverse; read only |

Rays pass through (u + 0.5, v + 0.5): the center of the first pixel is (0.5, 0.5); omnisim's is
(0, 0). `transform_matrix` maps the camera frame to the world. The camera frame has OpenGL's axes (y
up, z back), rotated by half a turn about x from omnisim's. A frame's pose is named
world_from_<its file_path>.

Instant-ngp's `is_fisheye` stands for OPENCV_FISHEYE. In place of a focal length a file may have the
field of view of a pinhole camera: `camera_angle_x`, `camera_angle_y` in radians, `x_fov`, `y_fov`
in degrees. Without `w` and `h`, as in NeRF's synthetic scenes, the size is that of the images.

Source: nerfstudio's documentation, "Data conventions"; its module cameras; instant-ngp's
nerf_loader.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    EquirectangularCamera,
    FThetaInverseCamera,
    KannalaBrandtCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.errors import CalibrationError
from omnisim.core.files.parameters import Flag, Number

CENTER_PX = 0.5  # center of the first pixel
OPENGL_FROM_OPENCV = np.array([1.0, -1.0, -1.0, 1.0])
PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "PERSPECTIVE")
FISHEYES = ("OPENCV_FISHEYE", "FISHEYE")
NerfstudioLens = UnifiedCamera | KannalaBrandtCamera | EquirectangularCamera
FOCAL_TOLERANCE = 1e-3  # relative difference of two statements of a focal length
OTHER_LENS = Unread("a lens of instant-ngp that is not read: state a camera_model", is_fault=True)


class _Intrinsics(
    ForeignTable,
    unread={
        "fisheye_crop_radius": Unread("black beyond it: theta_max_deg of a sensor file"),
        "distortion_params": Unread("state k1, k2, k3, k4, p1, p2 in its place", is_fault=True),
        "rolling_shutter transform_matrix_start transform_matrix_end": documents.ROLLING_SHUTTER,
        "equirectangular orthographic k5 k6": OTHER_LENS,
    },
):
    """Intrinsics of all frames or of one."""

    camera_model: str | None = None
    is_fisheye: Flag | None = None
    fl_x: Number | None = None
    fl_y: Number | None = None
    cx: Number | None = None
    cy: Number | None = None
    w: documents.Size | None = None
    h: documents.Size | None = None
    k1: Number = 0.0
    k2: Number = 0.0
    k3: Number = 0.0
    k4: Number = 0.0
    p1: Number = 0.0
    p2: Number = 0.0
    camera_angle_x: Number | None = None
    camera_angle_y: Number | None = None
    x_fov: Number | None = None
    y_fov: Number | None = None
    latlong: Flag | None = None
    ftheta_p0: Number = 0.0
    ftheta_p1: Number = 0.0
    ftheta_p2: Number = 0.0
    ftheta_p3: Number = 0.0
    ftheta_p4: Number = 0.0


class _Frame(
    _Intrinsics,
    harmless=(
        "depth_file_path mask_path semantics_path normal_file_path rotation sharpness time "
        "timestamp colmap_im_id light driver_parameters"
    ),
):
    file_path: str = ""
    transform_matrix: documents.Matrix | None = None


class _File(
    _Intrinsics,
    inner={"frames": _Frame},
    unread={
        "applied_scale": Unread("positions are not in meters", (1,)),
        "from_na": Unread("poses have other axes"),
    },
    harmless=(
        "applied_transform aabb_scale scale offset up render_aabb orientation_override "
        "auto_scale_poses_override ply_file_path train_filenames val_filenames test_filenames "
        "n_extra_learnable_dims fix_premult enable_ray_loading enable_depth_loading "
        "integer_depth_scale white_transparent black_transparent mask_color"
    ),
):
    frames: tuple[dict[str, Any], ...] = ()


class Nerfstudio(Format[NerfstudioLens]):
    """Format of nerfstudio's data sets."""

    name = "nerfstudio"
    title = "Nerfstudio: transforms.json"
    suffix = ".json"
    models = (UnifiedCamera, KannalaBrandtCamera, EquirectangularCamera)
    fits = ((KannalaBrandtCamera, ANY), (UnifiedCamera, base.PINHOLE))
    signature = re.compile(r'\A\s*\{.*"(fl_x|camera_angle_x|transform_matrix)"\s*:', re.S)
    metadata_place = base.MetadataPlace.KEY
    has_names = False
    tables = (_File,)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse one camera per set of intrinsics, with the poses of its frames."""
        keys = _Intrinsics.model_fields
        shared = {key: document[key] for key in keys if key in document}
        files = {key: value for key, value in document.items() if key not in keys}
        frames = parse(files, _File, source).frames
        groups: dict[str, tuple[str, dict[str, Any], list[NamedPose], str]] = {}
        for index, frame in enumerate(frames or ({},)):
            place = f"{source}: frames.{index}" if frames else source
            own = {key: frame[key] for key in keys if key in frame}
            values = {**shared, **own}
            fields = parse({key: frame[key] for key in frame if key not in keys}, _Frame, place)
            new = (place if own else source, values, list[NamedPose](), fields.file_path)
            group = groups.setdefault(repr(values), new)
            if fields.transform_matrix is not None:
                matrix = documents.pose(fields.transform_matrix, f"{place}: transform_matrix")
                name = fields.file_path or f"frame{index}"
                group[2].append(NamedPose("world", name, matrix * OPENGL_FROM_OPENCV))
        cameras = []
        for index, (place, values, poses, image) in enumerate(groups.values()):
            name = f"camera{index}" if len(groups) > 1 else "camera"
            part = parse(values, _Intrinsics, place)
            notes: list[str] = []
            size = _size(part, Path(source).parent, image, place, notes)
            lens = _lens(part, size, place, notes)
            if len(groups) > 1 and len(poses) == 1:  # one camera per image: it takes its name
                name = poses[0].source
            cameras.append(ParsedCamera(name, lens, tuple(poses), notes=tuple(notes)))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[NerfstudioLens]]) -> str:
        """Text with the camera and one frame for each of its poses in the world."""
        (camera,) = cameras
        frames = [
            {"file_path": pose.source,
             "transform_matrix": documents.rows(pose.target_from_source * OPENGL_FROM_OPENCV)}
            for pose in camera.poses if pose.target == "world"
        ]  # fmt: skip
        return json.dumps({**intrinsics(camera.lens), "frames": frames}, indent=2) + "\n"


def _size(
    part: _Intrinsics, folder: Path, image: str, place: str, notes: list[str]
) -> tuple[int, int]:
    """Image size, from the file or from an image; adds a note if the two differ."""
    names = (image, f"{image}.png", f"{image}.jpg") if image else ()
    path = next((folder / name for name in names if (folder / name).is_file()), None)
    width, height = part.w, part.h
    if path is not None:
        from omnisim.core.files.image_files import read_image  # loads OpenImageIO

        rows, columns = map(int, read_image(path)[0].shape[:2])
        if width is None or height is None:
            return columns, rows
        if (width, height) != (columns, rows):
            notes.append(f"w, h = {width}, {height}, but {image} has {columns} × {rows} px")
    if width is None or height is None:
        key, hint = ("w" if width is None else "h"), f", or the image {image} beside the file"
        hint = f": expected it{hint}" if image else ""
        raise CalibrationError(f"{place}: {key}: missing{hint}")
    return width, height


def _focal_px(
    part: _Intrinsics, axis: str, side_px: int, place: str, notes: list[str]
) -> float | None:
    """Focal length along an axis, px, or None; adds a note if two statements differ."""
    first = taken = None
    for key, per_unit, straight in (
        (f"fl_{axis}", None, ""),
        (f"camera_angle_{axis}", 1.0, "π"),
        (f"{axis}_fov", math.radians(1.0), "180"),
    ):
        value = focal_px = getattr(part, key)
        if value is not None and per_unit is not None:
            if not 0.0 < value * per_unit < math.pi:
                raise unexpected(f"{place}: {key}", f"more than 0 and less than {straight}", value)
            focal_px = 0.5 * side_px / math.tan(0.5 * value * per_unit)
        if taken is None:
            first, taken = key, focal_px
        elif focal_px is not None and abs(focal_px - taken) > FOCAL_TOLERANCE * abs(taken):
            notes.append(
                f"{key} = {value:g} is not read: it is a focal length of {focal_px:.6g} px, but "
                f"{first} states {taken:.6g} px"
            )
    return taken


def _note_unused(part: _Intrinsics, same: Mapping[str, Any], lens: str, notes: list[str]) -> None:
    """Add a note on keys of other lenses than `lens`, which has those in `same` by their values."""
    own = {"camera_model", "latlong", "w", "h"}
    unused = {key: value for key, value in part if value and key not in own}
    shown = [f"{key} = {value}" for key, value in unused.items() if same.get(key) != value]
    if shown:
        notes.append(f"{', '.join(shown)}: not read in {lens}")


def _lens(part: _Intrinsics, size: tuple[int, int], place: str, notes: list[str]) -> CentralCamera:
    f_theta = tuple(getattr(part, f"ftheta_p{power}") for power in range(5))
    stated = "EQUIRECTANGULAR" if part.latlong else "FTHETA" if any(f_theta) else None
    model = part.camera_model or stated or ("OPENCV_FISHEYE" if part.is_fisheye else "OPENCV")
    if stated not in (None, model) or (part.latlong is False and model == "EQUIRECTANGULAR"):
        raise unexpected(f"{place}: camera_model", "none beside latlong or ftheta_p0", model)
    models = (*PINHOLES, *FISHEYES, "EQUIRECTANGULAR", *([stated] if stated else ()))
    documents.check_choice(model, models, f"{place}: camera_model")
    if stated is None and part.is_fisheye is not None and part.is_fisheye != (model in FISHEYES):
        kind = "a fisheye" if part.is_fisheye else "no fisheye"
        raise unexpected(f"{place}: camera_model", f"{kind}, as is_fisheye states", model)
    width, height = size
    if model == "EQUIRECTANGULAR":
        panorama = EquirectangularCamera(width, height)
        _note_unused(part, intrinsics(panorama), "a panorama", notes)
        return panorama
    u = 0.5 * width if part.cx is None else part.cx
    v = 0.5 * height if part.cy is None else part.cy
    if model == "FTHETA":
        if f_theta[0]:
            raise unexpected(f"{place}: ftheta_p0", "0, the axis at cx, cy", f_theta[0])
        used = {key: value for key, value in part if key in ("cx", "cy") or "ftheta" in key}
        _note_unused(part, used, "an f-theta lens", notes)
        with error_context(place):
            return FThetaInverseCamera(width, height, (u - CENTER_PX, v - CENTER_PX), f_theta[1:])
    focal = _focal_px(part, "x", width, place, notes)
    other = _focal_px(part, "y", height, place, notes)
    if focal is None and (other is None or part.fl_y is not None):
        raise CalibrationError(f"{place}: fl_x: missing")
    focal, other = (px for px in (focal or other, other or focal) if px is not None)
    known = base.Intrinsics(width, height, (focal, other), (u - CENTER_PX, v - CENTER_PX))
    with error_context(place):
        if model in FISHEYES:
            if part.p1 or part.p2:
                raise unexpected(f"{place}: p1, p2", "0 in a fisheye", [part.p1, part.p2])
            return KannalaBrandtCamera(*known, (part.k1, part.k2, part.k3, part.k4))
        if part.k4:
            raise unexpected(f"{place}: k4", f"0 with camera_model {model}", part.k4)
        four = part.k1, part.k2, part.p1, part.p2
        return base.pinhole(known, (*four, part.k3) if part.k3 else four)


def intrinsics(lens: NerfstudioLens) -> dict[str, Any]:
    """Keys that describe a lens's intrinsics."""
    size = {"w": lens.width_px, "h": lens.height_px}
    if isinstance(lens, EquirectangularCamera):
        u, v = 0.5 * lens.width_px, 0.5 * lens.height_px
        focal = {"fl_x": u, "fl_y": float(lens.height_px)}
        return {"camera_model": "EQUIRECTANGULAR", **focal, "cx": u, "cy": v, **size}
    (fx, fy), (u, v) = lens.focal_lengths_px, lens.principal_point_px
    start = {"fl_x": fx, "fl_y": fy, "cx": u + CENTER_PX, "cy": v + CENTER_PX, **size}
    if isinstance(lens, KannalaBrandtCamera):
        named = zip(("k1", "k2", "k3", "k4"), lens.coefficients, strict=True)
        return {"camera_model": "OPENCV_FISHEYE", **start, **dict(named)}
    named = zip(("k1", "k2", "p1", "p2", "k3"), lens.distortion, strict=False)
    model = "OPENCV" if any(lens.distortion) else "PINHOLE"
    return {"camera_model": model, **start, **dict(named)}
