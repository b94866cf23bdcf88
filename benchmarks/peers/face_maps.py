"""Remapping of square faces to the mirror's image, by OpenCV's `remap`."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.peer import CAMERA, mirror_rays
from omnisim.cameras import HyperbolicCamera
from omnisim.core.cube import face_index, face_tangents
from omnisim.core.srgb import linear_from_srgb

CAPTURES = 8  # samples along each side of a pixel of the reference
_BANDS = 24  # of the reference's rows, one after the other: its rays take gigabytes


class FaceMaps:
    """Remap tables from pixels to texels of the faces, computed once.

    Args:
        camera: camera of the image.
        face_px: width of a face, px.
        faces: number of faces side by side, in the order of `omnisim.core.cube.FACE_NAMES`.
    """

    def __init__(self, camera: HyperbolicCamera, face_px: int, faces: int):
        import cv2

        x, y, self.valid = _texels(camera, face_px, faces)
        self._maps = cv2.convertMaps(x, y, cv2.CV_16SC2)
        self._outside = ~self.valid

    def remap(self, faces: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Image (height, width, 3), interpolated bilinearly; black where invalid."""
        import cv2

        image = cv2.remap(faces, *self._maps, cv2.INTER_LINEAR).astype(np.uint8, copy=False)
        image[self._outside] = 0
        return image


def _texels(
    camera: HyperbolicCamera, face_px: int, faces: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Columns and rows (height, width) of the texels, and the mask of valid pixels."""
    rays, valid = mirror_rays(camera)
    index = np.minimum(face_index(rays), faces - 1)
    tangents = face_tangents(rays, index)
    # clamped to the center of a face's last texel: the next face begins beyond it
    texels = np.clip(0.5 * face_px * (tangents + 1.0) - 0.5, 0.0, face_px - 1.0)
    columns = texels[..., 0] + face_px * index
    return columns.astype(np.float32), texels[..., 1].astype(np.float32), valid


@cache
def _fine_bands(
    face_px: int, faces: int
) -> list[tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]]:
    """Remap tables of the supersampled image behind the reference, in bands of rows."""
    import dataclasses

    fine = CAMERA.scaled(CAPTURES)
    u, v = fine.principal_point_px
    rows = fine.height_px // _BANDS
    return [
        _texels(
            dataclasses.replace(fine, height_px=rows, principal_point_px=(u, v - band * rows)),
            face_px,
            faces,
        )
        for band in range(_BANDS)
    ]


def averaged(linear_faces: NDArray[np.float32], faces: int) -> NDArray[np.float32]:
    """Reference (height, width, 3): 8 × 8 samples per pixel, averaged in linear light.

    Args:
        linear_faces: (size, faces * size, 3) faces side by side.
        faces: number of faces.
    """
    import cv2

    parts = []
    for x, y, valid in _fine_bands(len(linear_faces), faces):
        captured = cv2.remap(linear_faces, x, y, cv2.INTER_LINEAR).astype(np.float32, copy=False)
        captured[~valid] = 0.0
        counts = _blocks(valid[..., None].astype(np.float32))
        parts.append(_blocks(captured) / np.maximum(counts, 1.0))
    return np.concatenate(parts)


def _blocks(fine: NDArray[np.float32]) -> NDArray[np.float32]:
    height, width, channels = fine.shape
    blocks = fine.reshape(height // CAPTURES, CAPTURES, width // CAPTURES, CAPTURES, channels)
    sums: NDArray[np.float32] = blocks.sum(axis=(1, 3))
    return sums


def linear_from_levels(levels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear light of 8-bit sRGB levels."""
    return linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)[levels]
