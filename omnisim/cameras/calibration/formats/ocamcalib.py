"""OCamCalib's calib_results.txt: five blocks, with comments between.

    N a0 a1 … a_{N−1}        the polynomial F(ρ)
    M p0 p1 … p_{M−1}        its inverse: ρ as a polynomial of atan(z/ρ), for cam2world's callers
    row column               the center, from 0 unless a comment says MATLAB or "starting from 1"
    c d e                    the affine map
    height width

In the toolbox, x points down, y points right, and the camera looks along −z.
`cameras/models/ocamcalib.py` has the rotation to omnisim's axes. Lenses and mirrors share it; only
omnisim's metadata tells them apart. The inverse is fitted here, as in the toolbox; that of a file
is compared with the direct polynomial.

MATLAB's own fisheye is the same model as JSON, as jsonencode writes a fisheyeIntrinsics:

    (x, y) = StretchMatrix⁻¹ (point − DistortionCenter), x right, y down, pixels from 1
    z = a0 + a2 ρ² + a3 ρ³ + a4 ρ⁴, MappingCoefficients; it looks along +z

With the stretch matrix [[c, d], [e, 1]], the toolbox's plane is c times as large: its polynomial is
−aₙ c^(1 − n), and its affine map is 1/c, e/c, d/c. A cameraParameters, as toStruct gives it, is a
pinhole camera with OpenCV's coefficients, the skew and pixels from 1.

Source: Scaramuzza's toolbox, its C functions and calib_results.txt; MATLAB's documentation of
fisheyeIntrinsics, cameraParameters and undistortFisheyePoints.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from omnisim.cameras import CentralCamera, OcamcalibCamera, UnifiedCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import ForeignTable, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError

BLOCKS = ("polynomial", "inverse polynomial", "center", "affine parameters", "image size")
COUNTS = (0, 0, 2, 3, 2)  # numbers per block; 0: the first number counts the others
INVERSE_TOLERANCE_PX = 1.0  # of a file's inverse polynomial
INVERSE_WITHIN_PX = 0.01  # as in the toolbox's findinvpoly
MAX_INVERSE_COEFFICIENTS = 25
_FROM_ONE = re.compile(r"^[ \t]*#.*(starting from 1|matlab convention)", re.M | re.I)


class Ocamcalib(Format[OcamcalibCamera]):
    """Format of Scaramuzza's toolbox."""

    name = "ocamcalib"
    title = "OCamCalib: calib_results.txt"
    suffix = ".txt"
    models = (OcamcalibCamera,)
    fits = ((OcamcalibCamera, ANY),)
    signature = re.compile(r"^[ \t]*#.*(DIRECT mapping|polynomial coefficients)", re.M | re.I)
    has_names = False

    def looks_like(self, text: str) -> bool:
        """True for the toolbox's comments, or for blocks of the right lengths without comments."""
        if super().looks_like(text):
            return True
        lines = _lines(text)
        if [len(words) for _, words in lines[2:]] != [2, 3, 2]:
            return False
        try:
            return all(documents.parse_number(word, "") is not None for word in lines[2][1])
        except CalibrationError:
            return False

    def read(self, document: str, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        lines = _lines(document)
        if len(lines) != len(BLOCKS):
            blocks_named = f"{len(BLOCKS)} lines of numbers: {', '.join(BLOCKS)}"
            raise unexpected(source, blocks_named, len(lines))
        blocks = []
        for (line, words), block, count in zip(lines, BLOCKS, COUNTS, strict=True):
            place = f"{source}: line {line}: {block}"
            values = [documents.parse_number(word, place) for word in words]
            expected = float(count) if count else values.pop(0)
            if len(values) != expected:
                raise CalibrationError(f"{place}: expected {expected:g} numbers, got {len(values)}")
            blocks.append(values)
        polynomial, inverse, (row, column), affine, _ = blocks
        height, width = (documents.parse_size(word, place) for word in lines[-1][1])
        first = 1.0 if _FROM_ONE.search(document) else 0.0
        center = column - first, row - first
        with error_context(source):
            lens = OcamcalibCamera(width, height, center, tuple(polynomial), tuple(affine))
        return [ParsedCamera("camera", lens, notes=_contradictions(lens, inverse))]

    def encode(self, cameras: Sequence[ParsedCamera[OcamcalibCamera]]) -> str:
        """Text of a file with the camera and the inverse polynomial."""
        (camera,) = cameras
        lens = camera.lens
        column, row = lens.principal_point_px
        inverse = inverse_polynomial(lens)
        return f"""#polynomial coefficients for the DIRECT mapping function (cam2world)

{len(lens.polynomial)} {_numbers(lens.polynomial)}

#polynomial coefficients for the inverse mapping function (world2cam)

{len(inverse)} {_numbers(inverse)}

#center: "row" and "column", starting from 0 (C convention)

{_numbers((row, column))}

#affine parameters "c", "d", "e"

{_numbers(lens.affine)}

#image size: "height" and "width"

{lens.height_px} {lens.width_px}

"""


def _lines(text: str) -> list[tuple[int, list[str]]]:
    """Line numbers and words of the lines that are not comments."""
    split = ((number, line.split()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, words) for number, words in split if words and not words[0].startswith("#")]


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def inverse_polynomial(lens: OcamcalibCamera) -> list[float]:
    """Shortest inverse polynomial, ρ by atan(F(ρ)/ρ), accurate to a hundredth of a pixel.

    It covers the angles in the image; the toolbox's world2cam needs it.
    """
    theta, radius = _profile(lens, 1.05)
    elevation = theta - 0.5 * math.pi
    for degree in range(1, MAX_INVERSE_COEFFICIENTS):
        fitted = Chebyshev.fit(elevation, radius, degree)
        if np.abs(fitted(elevation) - radius).max() < INVERSE_WITHIN_PX:
            break
    return fitted.convert(kind=Polynomial).coef.tolist()


def _profile(lens: OcamcalibCamera, reach: float) -> tuple[Floats, Floats]:
    """Angles (n,) from the axis up to `reach` times the image's largest, and their radii, px."""
    u, v = (np.linspace(0.0, side - 1.0, 65) for side in (lens.width_px, lens.height_px))
    rays = lens.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    directions = rays.directions[rays.valid]
    theta = np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), directions[:, 2])
    highest = min(float(theta.max(initial=0.1)) * reach, lens.theta_edge_rad)
    theta = np.linspace(0.0, highest, 400)
    unskewed = dataclasses.replace(lens, affine=(1.0, 0.0, 0.0))
    along_u = np.stack((np.sin(theta), 0.0 * theta, np.cos(theta)), axis=-1)
    return theta, unskewed.pixel_from_ray(along_u).positions_px[:, 0] - lens.principal_point_px[0]


def _contradictions(lens: OcamcalibCamera, inverse: Sequence[float]) -> tuple[str, ...]:
    """Note on an inverse polynomial that contradicts the direct one."""
    theta, radius = _profile(lens, 1.0)

    def errors_px(angle: Floats) -> Floats:
        return np.asarray(np.abs(Polynomial(inverse or [0.0])(angle) - radius))

    most_px = errors_px(theta - 0.5 * math.pi).max()
    if most_px <= INVERSE_TOLERANCE_PX:
        return ()
    reason = f"is up to {most_px:.3g} px off the direct one"
    if not any(inverse):
        reason = "is all zeros"
    elif np.median(errors_px(theta)) <= INVERSE_TOLERANCE_PX:  # it may end before the corners
        reason += ", as it takes angles from the axis, not from the image plane"
    return (f"the inverse polynomial {reason}: it is not read",)


TAYLOR = {f"polynomial.{power}": None for power in (1, 5, 6)}  # powers that MATLAB lacks
FIRST_PX = 1.0  # center of MATLAB's first pixel


PINHOLE_KEYS = ("K", "IntrinsicMatrix", "RadialDistortion", "TangentialDistortion")
FISHEYE_KEYS = ("DistortionCenter", "StretchMatrix")


class _Parameters(
    ForeignTable,
    harmless="WorldPoints WorldUnits EstimateSkew EstimateTangentialDistortion Version "
    "NumRadialDistortionCoefficients RotationVectors TranslationVectors RotationMatrices "
    "ReprojectionErrors ReprojectedPoints DetectedKeypoints NumPatterns MeanReprojectionError "
    "PatternExtrinsics FocalLength PrincipalPoint Skew EstimateAlignment",
):
    ImageSize: documents.Numbers
    MappingCoefficients: documents.Numbers | None = None
    DistortionCenter: documents.Numbers | None = None
    StretchMatrix: documents.Matrix | None = None
    K: documents.Matrix | None = None
    IntrinsicMatrix: documents.Matrix | None = None
    RadialDistortion: documents.Numbers | None = None
    TangentialDistortion: documents.Numbers | None = None


class _Calibration(_Parameters, inner={"Intrinsics": _Parameters}):
    """Intrinsics, or an object that has them."""


class Matlab(Format[OcamcalibCamera | UnifiedCamera]):
    """Format of MATLAB's fisheyes and pinhole cameras."""

    name = "matlab"
    title = "MATLAB: fisheyeIntrinsics, cameraParameters json"
    suffix = ".json"
    models = (OcamcalibCamera, UnifiedCamera)
    fits = ((OcamcalibCamera, TAYLOR), (UnifiedCamera, base.PINHOLE))
    signature = re.compile(r'"(MappingCoefficients|RadialDistortion|IntrinsicMatrix)"\s*:')
    metadata_place = base.MetadataPlace.KEY
    tables = (_Calibration,)
    has_names = False
    unified_terms = frozenset({"k3", "skew"})

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        fields = document.get("Intrinsics", document)
        part = parse(fields, _Parameters, source)
        notes = tuple(
            f"{key} = {documents.short(value)} is not read: Intrinsics has another"
            for key, value in document.items()
            if key in _Parameters.model_fields and value != fields.get(key)
        )
        height, width = documents.counted(part.ImageSize, "rows columns", f"{source}: ImageSize")
        place = f"{source}: ImageSize"
        columns, rows = (documents.parse_size(str(side), place) for side in (width, height))
        is_fisheye = part.MappingCoefficients is not None
        keys = PINHOLE_KEYS if is_fisheye else FISHEYE_KEYS
        foreign = [key for key in keys if getattr(part, key) is not None]
        if foreign:
            kind = "a fisheye's" if is_fisheye else "a pinhole camera's"
            raise unexpected(source, f"{kind} keys alone", ", ".join(foreign))
        if part.MappingCoefficients is None:
            return [ParsedCamera("camera", _pinhole(part, (columns, rows), source), notes=notes)]
        place = f"{source}: MappingCoefficients"
        a0, *others = documents.counted(part.MappingCoefficients, "a0 a2 a3 a4", place)
        center = documents.counted(
            part.DistortionCenter or [], "cx cy", f"{source}: DistortionCenter"
        )
        stretch = np.ravel(part.StretchMatrix or np.eye(2)).tolist()
        c, d, e, one = documents.counted(stretch, "c d e 1", f"{source}: StretchMatrix")
        if one != 1.0 or c <= 0.0:
            raise unexpected(f"{source}: StretchMatrix", "[[c, d], [e, 1]] with c > 0", stretch)
        with error_context(source):
            terms = (-a * c ** (1 - n) for n, a in enumerate((a0, 0.0, *others)))
            u, v = np.subtract(center, FIRST_PX).tolist()
            lens = OcamcalibCamera(columns, rows, (u, v), tuple(terms), (1.0 / c, e / c, d / c))
        return [ParsedCamera("camera", lens, notes=notes)]

    def encode(self, cameras: Sequence[ParsedCamera[OcamcalibCamera | UnifiedCamera]]) -> str:
        """Text of a file with the camera."""
        (lens,) = (camera.lens for camera in cameras)
        u, v = np.add(lens.principal_point_px, FIRST_PX).tolist()
        data: dict[str, Any] = {"ImageSize": [lens.height_px, lens.width_px]}
        if isinstance(lens, UnifiedCamera):
            (fx, fy), (k1, k2, *tangential) = lens.focal_lengths_px, lens.distortion[:4]
            data["K"] = [[fx, lens.skew_px, u], [0.0, fy, v], [0.0, 0.0, 1.0]]
            data["RadialDistortion"] = [k1, k2, lens.k3]
            data["TangentialDistortion"] = tangential
        else:
            c, d, e = 1.0 / lens.affine[0], lens.affine[2], lens.affine[1]
            terms = (*lens.polynomial, 0.0, 0.0, 0.0, 0.0)[:5]
            scaled = [-term * c ** (n - 1) for n, term in enumerate(terms)]
            data["MappingCoefficients"] = [scaled[0], *scaled[2:]]
            data["DistortionCenter"] = [u, v]
            data["StretchMatrix"] = [[c, d * c], [e * c, 1.0]]
        return json.dumps(data, indent=2) + "\n"

    def unsupported(self, lens: OcamcalibCamera | UnifiedCamera) -> str | None:
        """Rejects other powers of a fisheye's polynomial."""
        if isinstance(lens, UnifiedCamera):
            return super().unsupported(lens)
        is_other = any(lens.polynomial[1:2]) or any(lens.polynomial[5:])
        return "its polynomial is of a0, a2, a3 and a4" if is_other else None


def _pinhole(part: _Parameters, size: tuple[int, int], source: str) -> CentralCamera:
    """Pinhole camera of a cameraParameters; its older matrix is the transposed one."""
    matrix, key = (part.K, "K") if part.K is not None else (part.IntrinsicMatrix, "IntrinsicMatrix")
    if matrix is None:
        raise CalibrationError(f"{source}: K: missing")
    values = np.ravel(matrix if key == "K" else np.transpose(matrix)).tolist()
    if part.IntrinsicMatrix and values != np.ravel(np.transpose(part.IntrinsicMatrix)).tolist():
        raise unexpected(f"{source}: IntrinsicMatrix", "the transposed K", part.IntrinsicMatrix)
    intrinsics, skew = base.matrix_intrinsics(size, values, f"{source}: {key}")
    u, v = np.subtract(intrinsics.principal_point_px, FIRST_PX).tolist()
    radial = part.RadialDistortion or [0.0, 0.0]
    names = "k1 k2 k3" if len(radial) == 3 else "k1 k2"
    k1, k2, *k3 = documents.counted(radial, names, f"{source}: RadialDistortion")
    tangential = part.TangentialDistortion or [0.0, 0.0]
    p1, p2 = documents.counted(tangential, "p1 p2", f"{source}: TangentialDistortion")
    with error_context(source):
        distortion = (k1, k2, p1, p2, *k3) if any(k3) else (k1, k2, p1, p2)
        return base.pinhole(intrinsics._replace(principal_point_px=(u, v)), distortion, skew)
