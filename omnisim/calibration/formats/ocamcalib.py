"""OCamCalib's calib_results.txt: five blocks, with comments between.

    N a0 a1 … a_{N−1}        the polynomial F(ρ)
    M p0 p1 … p_{M−1}        its inverse: ρ as a polynomial of atan(z/ρ), for cam2world's callers
    row column               of the centre, from 0 unless a comment says MATLAB or "starting from 1"
    c d e                    the affine map
    height width

The toolbox's x is down, y to the right, and it looks along −z; see `cameras/ocamcalib.py` for the
turn to our axes, which is the same for lenses and mirrors: which of both it is the file does not
say, but in a remark of ours. The inverse is fitted here, as the toolbox does it.

Source: Scaramuzza's toolbox, its C functions and calib_results.txt.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from omnisim.calibration.fields import LARGEST_SIZE_PX, short
from omnisim.calibration.formats.format import Format, Said, making, nameless
from omnisim.cameras import OcamcalibCamera
from omnisim.errors import CalibrationError

BLOCKS = ("polynomial", "inverse polynomial", "centre", "affine parameters", "image size")
INVERSE_WITHIN_PX = 0.01  # as the toolbox's findinvpoly
MOST_INVERSE = 25
_FROM_ONE = re.compile(r"^[ \t]*#.*(starting from 1|matlab convention)", re.M | re.I)


def _looks_like(text: str) -> bool:
    if re.search(r"^[ \t]*#.*(DIRECT mapping|polynomial coefficients)", text, re.M | re.I):
        return True
    lines = _lines(text)
    counts = [len(words) for _, words in lines]
    return len(lines) == 5 and counts[2:] == [2, 3, 2] and all(map(_is_number, lines[2][1]))


def _lines(text: str) -> list[tuple[int, list[str]]]:
    """Numbers and words of the lines that are no comments."""
    split = ((number, line.split()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, words) for number, words in split if words and not words[0].startswith("#")]


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _read(text: str, source: str) -> list[Said]:
    lines = _lines(text)
    if len(lines) != len(BLOCKS):
        raise CalibrationError(
            f"{source}: {len(lines)} lines of numbers: want {len(BLOCKS)}: " + ", ".join(BLOCKS)
        )
    blocks, places = [], []
    for (number, words), block in zip(lines, BLOCKS, strict=True):
        places.append(f"{source}: line {number}: {block}")
        wrong = next((word for word in words if not _is_number(word)), None)
        if wrong is not None:
            raise CalibrationError(f"{places[-1]}: {short(wrong)}: want a number")
        blocks.append([float(word) for word in words])
    places = [
        f"{source}: line {number}: {block}"
        for (number, _), block in zip(lines, BLOCKS, strict=True)
    ]
    for index in (0, 1):
        if blocks[index][0] != len(blocks[index]) - 1:
            raise CalibrationError(
                f"{places[index]}: says {blocks[index][0]:g} coefficients and has "
                f"{len(blocks[index]) - 1}"
            )
    for index, count in ((2, 2), (3, 3), (4, 2)):
        if len(blocks[index]) != count:
            raise CalibrationError(f"{places[index]}: {len(blocks[index])} numbers: want {count}")
    row, column = blocks[2]
    height, width = blocks[4]
    if not all(1 <= side <= LARGEST_SIZE_PX and side == int(side) for side in (height, width)):
        raise CalibrationError(f"{places[4]}: {height:g} {width:g}: want height and width")
    first = 1.0 if _FROM_ONE.search(text) else 0.0
    with making(source):
        lens = OcamcalibCamera(
            int(width),
            int(height),
            (column - first, row - first),
            tuple(blocks[0][1:]),
            tuple(blocks[3]),
        )
    return [Said("camera", lens)]


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    lens: Any = camera.lens
    column, row = lens.principal_point_px
    inverse = inverse_polynomial(lens)

    def numbers(values: Sequence[float]) -> str:
        return " ".join(repr(float(value)) for value in values)

    return f"""#polynomial coefficients for the DIRECT mapping function (cam2world)

{len(lens.polynomial)} {numbers(lens.polynomial)}

#polynomial coefficients for the inverse mapping function (world2cam)

{len(inverse)} {numbers(inverse)}

#center: "row" and "column", starting from 0 (C convention)

{numbers((row, column))}

#affine parameters "c", "d", "e"

{numbers(lens.affine)}

#image size: "height" and "width"

{lens.height_px} {lens.width_px}

"""


def inverse_polynomial(lens: OcamcalibCamera) -> list[float]:
    """Coefficients of ρ by atan(F(ρ)/ρ), as few as come within a hundredth of a pixel.

    Over the angles that the picture shows; the toolbox's world2cam needs them.
    """
    u, v = (np.linspace(0.0, side - 1.0, 65) for side in (lens.width_px, lens.height_px))
    rays = lens.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    directions = rays.directions[rays.valid]
    theta = np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), directions[:, 2])
    highest = min(float(theta.max(initial=0.1)) * 1.05, lens.theta_edge_rad)
    theta = np.linspace(0.0, highest, 400)
    unskewed = dataclasses.replace(lens, affine=(1.0, 0.0, 0.0))
    along_u = np.stack((np.sin(theta), 0.0 * theta, np.cos(theta)), axis=-1)
    radius = unskewed.pixel_from_ray(along_u).positions_px[:, 0] - lens.principal_point_px[0]
    elevation = theta - 0.5 * math.pi
    for degree in range(1, MOST_INVERSE):
        fitted = Chebyshev.fit(elevation, radius, degree)
        if np.abs(fitted(elevation) - radius).max() < INVERSE_WITHIN_PX:
            break
    return fitted.convert(kind=Polynomial).coef.tolist()


OCAMCALIB = Format(
    "ocamcalib",
    "OCamCalib: calib_results.txt",
    ".txt",
    _looks_like,
    _read,
    _write,
    (OcamcalibCamera,),
    ((OcamcalibCamera, {}),),
    rename=nameless,
)
