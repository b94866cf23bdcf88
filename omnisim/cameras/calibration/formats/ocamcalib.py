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

Source: Scaramuzza's toolbox, its C functions and calib_results.txt.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from omnisim.cameras import CentralCamera, OcamcalibCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import unexpected
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
