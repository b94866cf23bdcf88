"""Pinhole cameras with Brown's distortion, which many formats share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from omnisim.calibration.equivalents import equivalent
from omnisim.cameras import CentralCamera, PerspectiveCamera, UnifiedCamera


def pinhole(
    size_px: tuple[int, int],
    focal_lengths_px: tuple[float, float],
    principal_point_px: tuple[float, float],
    distortion: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    skew_px: float = 0.0,
) -> CentralCamera:
    """The pinhole camera with k1, k2, p1, p2: the unified one with ξ = 0, or the plain one."""
    unified = UnifiedCamera(
        *size_px, focal_lengths_px, principal_point_px, 0.0, tuple(distortion), skew_px
    )
    return equivalent(unified, PerspectiveCamera) or unified


def as_pinhole(lens: Any) -> UnifiedCamera | None:
    """A lens as a pinhole camera with distortion, or None."""
    unified = equivalent(lens, UnifiedCamera)
    return unified if isinstance(unified, UnifiedCamera) and unified.xi == 0.0 else None
