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
    """The pinhole camera with k1, k2, p1, p2 (k3): unified with ξ = 0, or the plain one."""
    unified = UnifiedCamera(
        *size_px, focal_lengths_px, principal_point_px, 0.0, tuple(distortion), skew_px
    )
    return equivalent(unified, PerspectiveCamera) or unified


def refuse_k3_and_skew(lens: Any) -> str | None:
    """Why a format with k1, k2, p1, p2 alone cannot say a lens."""
    if getattr(lens, "skew_px", 0.0):
        return "it has no skew"
    return refuse_k3(lens)


def refuse_k3(lens: Any) -> str | None:
    """Why a format with k1, k2, p1, p2 and a skew cannot say a lens."""
    return "it has no k3" if getattr(lens, "k3", 0.0) else None


def as_pinhole(lens: Any) -> UnifiedCamera | None:
    """A lens as a pinhole camera with distortion, or None."""
    unified = equivalent(lens, UnifiedCamera)
    return unified if isinstance(unified, UnifiedCamera) and unified.xi == 0.0 else None
