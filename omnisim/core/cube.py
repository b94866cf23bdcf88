"""Cube of virtual cameras around the effective viewpoint: faces and unfolded layout.

Each face is a pinhole camera with its own optical frame (x right, y down, z forward) in the rig
frame (x forward, y left, z up). The four side faces are upright. The top of the down face is the
rig's front; the up face continues the front face across its upper edge. No face is mirrored.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Bytes, Floats, Indices
from omnisim.core.errors import GraphicsError

FACE_NAMES = ("front", "left", "back", "right", "down", "up")

# Rows: the face's right, down and forward in the rig frame.
FACE_FROM_RIG: Floats = np.array(
    [
        [[0, -1, 0], [0, 0, -1], [1, 0, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[0, 1, 0], [0, 0, -1], [-1, 0, 0]],
        [[-1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[0, -1, 0], [-1, 0, 0], [0, 0, -1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    ],
    dtype=np.float64,
)

# The unfolded cube as one image: column and row of each face in a 3 × 2 grid. A cell shows slightly
# more than its face, so that filters at the face's edge do not reach into the next cell.
CELL_TANGENT = 1.0 + 1.0 / 32.0  # at the cell's edge; the face's edge is at 1
LAYOUT_COLUMNS, LAYOUT_ROWS = 3, 2
LAYOUT_CELLS = ((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1))


def face_index(directions_rig: ArrayLike) -> Indices:
    """Index (...,) into `FACE_NAMES` of the face that sees each direction (..., 3)."""
    directions = np.asarray(directions_rig, dtype=np.float64)
    forward = np.einsum("fj,...j->...f", FACE_FROM_RIG[:, 2], directions)
    return np.argmax(forward, axis=-1)


def face_tangents(directions_rig: ArrayLike, faces: ArrayLike) -> Floats:
    """Project directions (..., 3) onto faces (...,): tangents right and down (..., 2).

    Inside a face, both are in [−1, 1].
    """
    directions = np.asarray(directions_rig, dtype=np.float64)
    local = np.einsum("...ij,...j->...i", FACE_FROM_RIG[np.asarray(faces)], directions)
    return local[..., :2] / local[..., 2:]


def unfolded_cube(faces: dict[str, Bytes]) -> Bytes:
    """Unfold faces (size, size, 3) into one image of two rows and three columns.

    The layout matches the texture coordinates of an exported mirror.

    Cells of missing faces are black; smaller faces are enlarged to the largest. The border of a
    cell repeats the edge of its face.

    Raises:
        GraphicsError: there are no faces.
    """
    if not faces:
        raise GraphicsError("there are no faces to unfold")
    largest = max(face.shape[0] for face in faces.values())
    border = math.ceil(0.5 * (CELL_TANGENT - 1.0) * largest)
    size = round(2.0 * border / (CELL_TANGENT - 1.0))  # makes the border a whole number of pixels
    cell = size + 2 * border
    image = np.zeros((LAYOUT_ROWS * cell, LAYOUT_COLUMNS * cell, 3), dtype=np.uint8)
    for name, face in faces.items():
        column, row = LAYOUT_CELLS[FACE_NAMES.index(name)]
        nearest = np.clip(np.arange(-border, size + border), 0, size - 1) * face.shape[0] // size
        area = image[row * cell : (row + 1) * cell, column * cell : (column + 1) * cell]
        area[:] = face[nearest[:, None], nearest]
    return image
