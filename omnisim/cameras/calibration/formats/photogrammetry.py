"""Cameras of OpenSfM and OpenMVG, and the lenses of photogrammetry.

    q = g(θ) (cos φ, sin φ), r = |q|
    q' = q (1 + k1 r² + … + k6 r¹²) + 2 (p · q) q + r² p + r² (s0, s2) + r⁴ (s1, s3), p = (p2, p1)
    (u, v) = (fx q'_x + s q'_y + u0, fy q'_y + v0)

g is tan θ (perspective), θ (fisheye), 2 sin(θ/2) (equisolid), or t tan θ + (1 − t) θ (dual). A lens
that omnisim has no model for is read as the nearest one: fisheyes with p or s, since in
thin_prism_fisheye these act on the radially distorted point; dual; equisolid with coefficients;
perspective with k4.

A camera of OpenSfM:

| projection_type | model |
| --- | --- |
| perspective, simple_radial, radial, brown | unified with ξ = 0 |
| fisheye, fisheye_opencv | kannala_brandt |
| fisheye62, fisheye624 | thin_prism_fisheye if p and s are 0 |
| spherical, equirectangular | equirectangular of 2 : 1 |

Its lengths are in units of the image's longer side, and the principal point counts from the image's
center, (width − 1)/2 from the center of the first pixel. Poses, of a reconstruction.json, which is
read only, map the world to a shot's camera, and the rig to a rig camera; a rotation is an angle
times its axis. A camera model that several rig cameras share is several cameras.

A camera of OpenMVG has one focal length, in pixels; (0, 0) is the center of the first pixel:

| polymorphic_name | coefficients | model |
| --- | --- | --- |
| pinhole, pinhole_radial_k1, pinhole_radial_k3 | disto_k1, disto_k3 | unified with ξ = 0 |
| pinhole_brown_t2 | disto_t2: k1 k2 k3 t1 t2 | unified with ξ = 0 |
| fisheye | fisheye: k1 k2 k3 k4 | kannala_brandt |
| spherical | | equirectangular of 2 : 1 |

Its own code has panoramas half a pixel up and left of this. The keys tell the lens, as cereal names
only the first of each type.

Source: OpenSfM's modules io and geometry; OpenMVG's modules cameras, geometry and sfm, and cereal;
Metashape's manual, "Camera models".
"""

from __future__ import annotations

import json
import math
import re
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import polynomial
from pydantic import Field
from scipy.spatial.transform import Rotation

from omnisim.cameras import (
    CentralCamera,
    EquirectangularCamera,
    EquisolidCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import WORLD, NamedPose
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Fixed, Format, Intrinsics, ParsedCamera
from omnisim.cameras.camera import Rays
from omnisim.cameras.lens_polynomials import (
    first_root,
    polyval,
    solve_increasing,
    solve_polynomial,
    undistort,
)
from omnisim.cameras.parametric_camera import (
    EDGE_RAD,
    Coefficients,
    PlaneCamera,
    PlanePoints,
    TwoFocalCamera,
    unit_vectors,
)
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number
from omnisim.core.poses import inverse, pose_from_rotation

K, P, S = ("k1", "k2", "k3", "k4", "k5", "k6"), ("p1", "p2"), ("s0", "s1", "s2", "s3")
WEIGHTS = {
    "perspective": (1.0, 0.0, 0.0), "fisheye": (0.0, 1.0, 0.0), "equisolid": (0.0, 0.0, 1.0),
}  # fmt: skip
ROUNDING = 1e-13  # tolerance between a distorted point and the distortion of its inverse
STEP = 1e-6  # of the plane, for derivatives
SolvedLens = (
    UnifiedCamera
    | KannalaBrandtCamera
    | ThinPrismFisheyeCamera
    | EquisolidCamera
    | EquirectangularCamera
)


@dataclass(frozen=True)
class BrownLens(TwoFocalCamera, PlaneCamera, base.ForeignLens):
    """Lens of this module's formula, up to its first fold, or where other terms might fold it."""

    weights: tuple[Number, Number, Number]  # of tan θ, θ and 2 sin(θ/2) in g
    terms: Coefficients  # k1 … k6, p1, p2, s0 … s3
    skew_px: Number
    model_name = "brown"

    @property
    def nearest_models(self) -> tuple[tuple[type[CentralCamera], Fixed], ...]:
        """Model that is near."""
        pinhole = self.weights[0] == 1.0
        return ((RationalPolynomialCamera if pinhole else ThinPrismFisheyeCamera, ANY),)

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the projection ends."""
        return base.MAX_THETA_RAD if self.weights[0] else math.pi

    @cached_property
    def radius_limit(self) -> float:
        """Radius of the domain on the plane before distortion."""
        p1, p2, s0, s1, s2, s3 = self.terms[6:]
        radial = [term for k in (1.0, *self.terms[:6]) for term in (k, 0.0)]
        bend = 6.0 * math.hypot(p1, p2) + 2.0 * math.hypot(s0, s2)
        bends, highest = [0.0, bend, 0.0, 4.0 * math.hypot(s1, s3)], self._project(math.pi)
        slopes = radial, polynomial.polyder(polynomial.polymulx(radial))
        return min(first_root(polynomial.polysub(slope, bends), float(highest)) for slope in slopes)

    def _project(self, theta: Floats | float) -> Floats:
        theta = np.minimum(theta, self.theta_edge_rad)
        parts = np.array((np.tan(theta), theta, 2.0 * np.sin(0.5 * theta)))
        return np.asarray(np.tensordot(self.weights, parts, axes=1))

    def _slope(self, theta: Floats) -> Floats:
        parts = np.array((1.0 / np.cos(theta) ** 2, np.ones_like(theta), np.cos(0.5 * theta)))
        return np.asarray(np.tensordot(self.weights, parts, axes=1))

    def distort(self, plane: Floats) -> Floats:
        """Points q' (..., 2) of points q (..., 2)."""
        p1, p2, s0, s1, s2, s3 = self.terms[6:]
        squared = np.sum(plane * plane, axis=-1, keepdims=True)
        growth = polyval((1.0, *self.terms[:6]), squared) + 2.0 * (plane @ (p2, p1))[..., None]
        return np.asarray(plane * growth + squared * ((p2 + s0, p1 + s2) + squared * (s1, s3)))

    def _newton_step(self, plane: Floats, error: Floats) -> Floats:
        steps = STEP * np.eye(2)[:, None, :]
        jacobian = (self.distort(plane + steps) - self.distort(plane - steps)) / (2.0 * STEP)
        solved = np.linalg.solve(np.moveaxis(jacobian, 0, -1), error[..., None])
        return np.asarray(solved[..., 0])

    def _rays_from_plane(self, plane: Floats) -> Rays:
        skew = self.skew_px / self.focal_lengths_px[0]
        plane = plane - skew * plane[..., 1:] * (1.0, 0.0)
        radial = [term for k in (1.0, *self.terms[:6]) for term in (0.0, k)]
        radius = np.hypot(plane[..., 0], plane[..., 1])
        start = solve_polynomial(radial, radius, 0.0, self.radius_limit)[..., None]
        start = unit_vectors(plane, radius) * start
        point = undistort(self.distort, self._newton_step, start, plane, self.radius_limit)
        miss = np.abs(self.distort(point) - plane).max(axis=-1)
        bent = np.hypot(point[..., 0], point[..., 1])
        theta = solve_increasing(self._project, self._slope, bent, 0.0, self.theta_edge_rad)
        across = unit_vectors(point, bent) * np.sin(theta)[..., None]
        directions = np.concatenate((across, np.cos(theta)[..., None]), axis=-1)
        return Rays(directions, miss <= ROUNDING * np.maximum(1.0, radius))

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        across = np.hypot(directions[..., 0], directions[..., 1])
        theta = np.arctan2(across, directions[..., 2])
        radius = self._project(theta)
        valid = (theta <= self.theta_edge_rad + EDGE_RAD) & (radius <= self.radius_limit + EDGE_RAD)
        radius = np.minimum(radius, self.radius_limit)[..., None]
        plane = self.distort(unit_vectors(directions[..., :2], across) * radius)
        skew = self.skew_px / self.focal_lengths_px[0]
        return PlanePoints(plane + skew * plane[..., 1:] * (1.0, 0.0), valid)


def lens_from_terms(
    intrinsics: Intrinsics,
    projection: str,
    values: Mapping[str, float],
    skew_px: float = 0.0,
) -> CentralCamera:
    """Lens with k1 …, p1, p2 in OpenCV's order, s0 …, and transition t: those given."""
    k, p, s = (tuple(values.get(name, 0.0) for name in names) for names in (K, P, S))
    is_radial, (fx, fy) = not (any(p + s) or skew_px), intrinsics.focal_lengths_px
    if projection == "perspective" and not any(k[3:] + s):
        return base.pinhole(intrinsics, (*k[:2], *p, k[2])[: 5 if k[2] else 4], skew_px)
    if projection == "fisheye" and is_radial:
        if "k5" in values:
            return ThinPrismFisheyeCamera(*intrinsics, k)
        return KannalaBrandtCamera(*intrinsics, k[:4])
    if projection == "equisolid" and is_radial and not any(k) and fx == fy:
        return EquisolidCamera(*intrinsics[:2], fx, intrinsics.principal_point_px)
    share = values.get("transition", 0.0)
    weights = WEIGHTS.get(projection, (share, 1.0 - share, 0.0))
    return BrownLens(*intrinsics, weights, k + p + s, skew_px)


def terms_of(lens: SolvedLens) -> tuple[str, dict[str, float], float]:
    """Projection, k1 … and p1, p2 by name, and skew of a lens that the formats have."""
    if isinstance(lens, UnifiedCamera):
        k1, k2, p1, p2 = lens.distortion[:4]
        terms = {"k1": k1, "k2": k2, "k3": lens.k3, "p1": p1, "p2": p2}
        return "perspective", terms, lens.skew_px
    if isinstance(lens, KannalaBrandtCamera | ThinPrismFisheyeCamera):
        return "fisheye", dict(zip(K, lens.coefficients, strict=False)), 0.0
    return "spherical" if isinstance(lens, EquirectangularCamera) else "equisolid", {}, 0.0


def panorama(size: tuple[int, int], place: str) -> EquirectangularCamera:
    """Panorama of a size; refuses one that is not twice as wide as high."""
    if size[0] != 2 * size[1]:
        raise unexpected(f"{place}: width, height", "an image of 2 : 1", list(size))
    return EquirectangularCamera(*size)


class _AnyKey(ForeignTable):
    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        return True


def by_name(table: type[ForeignTable]) -> type[ForeignTable]:
    """Schema of tables under any keys."""
    return types.new_class("_ByName", (_AnyKey,), {"inner": {"*": table}})


class SolvedFormat(Format[SolvedLens]):
    """Base of the formats: fisheyes without tangential terms, panoramas of 2 : 1."""

    models: tuple[type[SolvedLens], ...] = (
        UnifiedCamera, KannalaBrandtCamera, ThinPrismFisheyeCamera, EquirectangularCamera,
    )  # fmt: skip
    fits: tuple[tuple[type[SolvedLens], Fixed], ...] = (
        (KannalaBrandtCamera, ANY),
        (UnifiedCamera, {**base.PINHOLE, **base.NO_SKEW}),
    )
    several = True

    def unsupported(self, lens: SolvedLens) -> str | None:
        """Reason why the format cannot represent a lens of one of its models, or None."""
        if isinstance(lens, ThinPrismFisheyeCamera) and any(lens.tangential + lens.prism):
            return "its tangential terms and its prism are of the point without radial distortion"
        if isinstance(lens, EquirectangularCamera) and lens.width_px != 2 * lens.height_px:
            return "its panoramas are twice as wide as high"
        return super().unsupported(lens)


# OpenSfM.


OPENSFM = {  # projection, and the parameters; those before a | are required
    "perspective": ("perspective", "focal | k1 k2"),
    "simple_radial": ("perspective", "focal_x focal_y | c_x c_y k1"),
    "radial": ("perspective", "focal_x focal_y | c_x c_y k1 k2"),
    "brown": ("perspective", "focal_x focal_y | c_x c_y k1 k2 p1 p2 k3"),
    "fisheye": ("fisheye", "focal | k1 k2"),
    "fisheye_opencv": ("fisheye", "focal_x focal_y | c_x c_y k1 k2 k3 k4"),
    "fisheye62": ("fisheye", "focal_x focal_y | c_x c_y k1 k2 k3 k4 k5 k6 p1 p2"),
    "fisheye624": ("fisheye", "focal_x focal_y | c_x c_y k1 k2 k3 k4 k5 k6 p1 p2 s0 s1 s2 s3"),
    "dual": ("dual", "focal transition | k1 k2"),
    "spherical": ("spherical", ""), "equirectangular": ("spherical", ""),
}  # fmt: skip
OPENSFM_NAMES = sorted({name for _, names in OPENSFM.values() for name in names.split()} - {"|"})


class _OpensfmCamera(
    ForeignTable,
    also_read=" ".join(OPENSFM_NAMES),
    harmless=" ".join(f"{name}_prior" for name in OPENSFM_NAMES),
):
    projection_type: str = "perspective"
    width: documents.Size
    height: documents.Size

    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        return key == "omnisim" or super().reads(key, value)


class _OpensfmPose(ForeignTable):
    rotation: documents.Numbers
    translation: tuple[Number, ...] = (0.0, 0.0, 0.0)

    def matrix(self, place: str) -> Floats:
        """Pose (4, 4) that it states."""
        parts = self.rotation, self.translation
        turn, position = (documents.counted(part, "x y z", place) for part in parts)
        return pose_from_rotation(Rotation.from_rotvec(turn).as_matrix(), position)


class _Shot(
    _OpensfmPose,
    harmless="orientation capture_time gps_dop gps_position compass accelerometer gravity_down "
    "skey vertices faces scale covariance merge_cc",
):
    camera: str


class _RigInstance(ForeignTable, harmless="rotation translation"):
    rig_camera_ids: dict[str, str] = Field(default_factory=dict)


class _Reconstruction(
    ForeignTable,
    inner={
        "cameras": by_name(_OpensfmCamera),
        "shots": by_name(_Shot),
        "rig_cameras": by_name(_OpensfmPose),
        "rig_instances": by_name(_RigInstance),
    },
    harmless="points pano_shots reference_lla biases",
):
    cameras: dict[str, dict[str, Any]]
    shots: dict[str, _Shot] = Field(default_factory=dict)
    rig_cameras: dict[str, _OpensfmPose] = Field(default_factory=dict)
    rig_instances: dict[str, _RigInstance] = Field(default_factory=dict)

    def views(self, camera: str, place: str) -> Iterator[tuple[str, tuple[NamedPose, ...]]]:
        """Names and poses of the cameras of a model."""
        instances = self.rig_instances.values()
        is_rig = any(len(one.rig_camera_ids) > 1 for one in instances)
        rig_of = {shot: rig for one in instances for shot, rig in one.rig_camera_ids.items()}
        shots = {name: shot for name, shot in self.shots.items() if shot.camera == camera}
        rigs = list(dict.fromkeys(rig_of.get(name, "") for name in shots)) or [""]
        for rig in rigs:
            view = camera if len(rigs) == 1 else rig or camera
            poses = [
                NamedPose(WORLD, name, inverse(shot.matrix(f"{place}: shots.{name}")))
                for name, shot in shots.items() if rig_of.get(name, "") == rig
            ]  # fmt: skip
            if rig in self.rig_cameras and is_rig:
                at = self.rig_cameras[rig].matrix(f"{place}: rig_cameras.{rig}")
                poses.append(NamedPose(view, "rig", at))
            yield view, tuple(poses)


class _Reconstructions(ForeignTable, inner={"reconstructions": _Reconstruction}):
    reconstructions: list[_Reconstruction]


class Opensfm(SolvedFormat):
    """Format of OpenSfM's camera models."""

    name = "opensfm"
    title = "OpenSfM: camera_models.json"
    suffix = ".json"
    signature = re.compile(r'\A\s*[\[{].*"projection_type"\s*:', re.S)
    metadata_place = base.MetadataPlace.CAMERA
    tables = (by_name(_OpensfmCamera), _Reconstructions)

    def document(self, text: str, source: str) -> Any:
        """Cameras by name, or the list of reconstructions under a key."""
        is_list = text.lstrip().startswith("[")
        return documents.parse_json(f'{{"reconstructions": {text}}}' if is_list else text, source)

    def table_of(self, document: Any) -> type[ForeignTable]:
        """Schema of a document."""
        return self.tables["reconstructions" in document]

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras; of several reconstructions, those of the first."""
        first, others = _Reconstruction(cameras={}), list[_Reconstruction]()
        if "reconstructions" in document:
            file = parse(document, _Reconstructions, source)
            first, *others = file.reconstructions or [first]
        more = (f"{len(others)} more reconstructions are not read",) if others else ()
        cameras = []
        models = first.cameras if "reconstructions" in document else document
        for name, camera in models.items():
            lens, notes = self._lens(camera, f"{source}: {name}")
            for view, poses in first.views(name, source):
                cameras.append(ParsedCamera(view, lens, poses, notes=(*notes, *more)))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[SolvedLens]]) -> str:
        """Text of a camera_models.json."""
        models = {}
        for name, lens in ((camera.name, camera.lens) for camera in cameras):
            projection, values, _ = terms_of(lens)
            fisheye = "fisheye62" if "k5" in values else "fisheye_opencv"
            kind = {"perspective": "brown", "fisheye": fisheye}.get(projection, projection)
            (width, height), (u, v) = (lens.width_px, lens.height_px), lens.principal_point_px
            if not isinstance(lens, EquirectangularCamera | EquisolidCamera):
                scale, (fx, fy) = max(width, height), lens.focal_lengths_px
                values |= {"focal_x": fx / scale, "focal_y": fy / scale}
                values["c_x"] = (u - 0.5 * (width - 1)) / scale
                values["c_y"] = (v - 0.5 * (height - 1)) / scale
            names = OPENSFM[kind][1].replace("|", "").split()
            model = {"projection_type": kind, "width": width, "height": height}
            models[name] = {**model, **{name: values.get(name, 0.0) for name in names}}
        return json.dumps(models, indent=4) + "\n"

    def _lens(self, camera: Any, place: str) -> tuple[CentralCamera, tuple[str, ...]]:
        """Lens of a camera, and a note on parameters of other projections."""
        part = parse(camera, _OpensfmCamera, place)
        kind, width, height = part.projection_type, part.width, part.height
        documents.check_choice(kind, OPENSFM, f"{place}: projection_type")
        projection, names = OPENSFM[kind]
        values = documents.numbers_by_name(camera, names, place)
        others = [name for name in OPENSFM_NAMES if camera.get(name) and name not in values]
        notes = (f"{', '.join(others)}: not read with projection_type {kind}",) if others else ()
        if projection == "spherical":
            return panorama((width, height), place), notes
        scale = max(width, height)
        fx, fy = (values.get(f"focal_{axis}", values.get("focal", 0.0)) * scale for axis in "xy")
        u, v = (values.get(f"c_{axis}", 0.0) * scale for axis in "xy")
        center = u + 0.5 * (width - 1), v + 0.5 * (height - 1)
        with base.error_context(place):
            return lens_from_terms(
                Intrinsics(width, height, (fx, fy), center), projection, values
            ), notes


# OpenMVG.


OPENMVG = {  # polymorphic_name, and the coefficients
    "disto_k1": ("pinhole_radial_k1", "k1"),
    "disto_k3": ("pinhole_radial_k3", "k1 k2 k3"),
    "disto_t2": ("pinhole_brown_t2", "k1 k2 k3 p1 p2"),
    "fisheye": ("fisheye", "k1 k2 k3 k4"),
}
ONE_FOCAL: Fixed = {"focal_lengths_px": None}
FIRST_ID = 1 << 31  # cereal's mark of the first object of a type
HALF_A_PIXEL = "OpenMVG's own panoramas are half a pixel up and left"


class _OpenmvgLens(ForeignTable):
    width: documents.Size
    height: documents.Size
    focal_length: Number | None = None
    principal_point: documents.Numbers | None = None
    disto_k1: documents.Numbers | None = None
    disto_k3: documents.Numbers | None = None
    disto_t2: documents.Numbers | None = None
    fisheye: documents.Numbers | None = None


class _Scene(
    ForeignTable,
    inner={"intrinsics": by_name(_OpenmvgLens)},
    unread={"extrinsics": Unread("poses of the images")},
    harmless="sfm_data_version root_path views structure control_points",
):
    intrinsics: dict[str, _OpenmvgLens]


class Openmvg(SolvedFormat):
    """Format of OpenMVG's scenes."""

    name = "openmvg"
    title = "OpenMVG: sfm_data.json"
    suffix = ".json"
    models = (UnifiedCamera, KannalaBrandtCamera, EquirectangularCamera)
    fits = (
        (KannalaBrandtCamera, ONE_FOCAL),
        (UnifiedCamera, {**base.PINHOLE, **base.NO_SKEW, **ONE_FOCAL}),
    )
    signature = re.compile(r'"sfm_data_version"\s*:')
    metadata_place = base.MetadataPlace.KEY
    tables = (_Scene,)

    def document(self, text: str, source: str) -> Any:
        """Content of a file, with intrinsics by key in place of cereal's list."""
        data, place = documents.parse_json(text, source), f"{source}: intrinsics"
        try:
            entries = {str(one["key"]): one["value"]["ptr_wrapper"] for one in data["intrinsics"]}
            parts = {key: wrapper["data"] for key, wrapper in entries.items()}
            data["intrinsics"] = {key: part.get("value0", part) for key, part in parts.items()}
        except (KeyError, TypeError, AttributeError):
            raise unexpected(place, "cereal's list", data.get("intrinsics")) from None
        return data

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras."""
        parts = parse(document, _Scene, source).intrinsics.items()
        lenses = {key: _openmvg_lens(part, f"{source}: intrinsics.{key}") for key, part in parts}
        return [
            ParsedCamera(key, lens, notes=self.lens_caveats(lens)) for key, lens in lenses.items()
        ]

    def encode(self, cameras: Sequence[ParsedCamera[SolvedLens]]) -> str:
        """Text of a file with the cameras."""
        entries: list[dict[str, Any]] = []
        types_known: list[str] = []
        for lens in (camera.lens for camera in cameras):
            data: dict[str, Any] = {"width": lens.width_px, "height": lens.height_px}
            projection, terms, _ = terms_of(lens)
            kind = "fisheye" if projection == "fisheye" else "disto_t2"
            name = "spherical" if projection == "spherical" else OPENMVG[kind][0]
            if isinstance(lens, UnifiedCamera | KannalaBrandtCamera):
                data["focal_length"] = lens.focal_lengths_px[0]
                data["principal_point"] = list(lens.principal_point_px)
                data[kind] = [terms[term] for term in OPENMVG[kind][1].split()]
            wrapper = {"id": FIRST_ID + 1 + len(entries), "data": data}
            if name == "spherical":
                wrapper["data"] = {"value0": data}
            mark: dict[str, Any] = {}
            if name not in types_known:
                types_known.append(name)
                mark = {"polymorphic_name": name}
            number = 1 + types_known.index(name) + (FIRST_ID if mark else 0)
            value = {"polymorphic_id": number, **mark, "ptr_wrapper": wrapper}
            entries.append({"key": int(cameras[len(entries)].name), "value": value})
        scene = {
            "sfm_data_version": "0.3", "root_path": "", "views": [], "intrinsics": entries,
            "extrinsics": [], "structure": [], "control_points": [],
        }  # fmt: skip
        return json.dumps(scene, indent=4) + "\n"

    def unsupported(self, lens: SolvedLens) -> str | None:
        """Reason why the format cannot represent a lens of one of its models, or None."""
        fx, fy = getattr(lens, "focal_lengths_px", (0.0, 0.0))
        return super().unsupported(lens) if fx == fy else "it has one focal length"

    def lens_caveats(self, lens: CentralCamera) -> tuple[str, ...]:
        """Note on panoramas."""
        is_panorama = isinstance(lens, EquirectangularCamera)
        return (HALF_A_PIXEL,) if is_panorama else super().lens_caveats(lens)

    def camera_name(self, index: int, name: str) -> str:
        """Number, as OpenMVG names its intrinsics."""
        return name if name.isascii() and name.isdecimal() else str(index)


def _openmvg_lens(part: _OpenmvgLens, place: str) -> CentralCamera:
    size = part.width, part.height
    focal, kinds = part.focal_length, [kind for kind in OPENMVG if getattr(part, kind) is not None]
    if focal is None and part.principal_point is None and not kinds:
        return panorama(size, place)
    if focal is None or len(kinds) > 1:
        raise unexpected(place, f"focal_length, and one of {', '.join(OPENMVG)}", kinds)
    u, v = documents.counted(part.principal_point or [], "u v", f"{place}: principal_point")
    values: dict[str, float] = {}
    for kind in kinds:
        names = OPENMVG[kind][1]
        numbers = documents.counted(getattr(part, kind), names, f"{place}: {kind}")
        values = dict(zip(names.split(), numbers, strict=True))
    projection = "fisheye" if kinds == ["fisheye"] else "perspective"
    with base.error_context(place):
        return lens_from_terms(Intrinsics(*size, (focal, focal), (u, v)), projection, values)
