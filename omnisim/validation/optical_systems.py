"""Optical systems of the checks: mirrors and windows in front of a pinhole."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omnisim.cameras.optics import OpticalSystem
from omnisim.cameras.optics.system_file import parse_optics

SIZE_PX = 360
_FOLDED = (
    {"name": "upper", "shape": "sphere", "radius_m": 0.15, "position_m": [0.0, 0.0, 0.12],
     "rim_radius_m": 0.02},
    {"name": "lower", "shape": "conic", "radius_m": -0.1, "conic": -1.0,
     "position_m": [0.0, 0.0, 0.02], "rim_radius_m": 0.07, "hole_radius_m": 0.012},
)  # fmt: skip
_TILTED = {"shape": "hyperbolic", "rim_radius_m": 0.0119, "decenter_m": [0.002, 0.0, 0.0],
           "tilt_deg": [2.0, 0.0, 0.0]}  # fmt: skip
_SPHERE = {"shape": "sphere", "radius_m": 0.03, "position_m": [0.0, 0.0, 0.15],
           "rim_radius_m": 0.029}  # fmt: skip
_CONE = {"shape": "cone", "half_angle_deg": 50.0, "position_m": [0.0, 0.0, 0.12],
         "rim_radius_m": 0.08}  # fmt: skip
_FLAT = {"shape": "port", "position_m": [0.0, 0.0, 0.02], "thickness_m": 0.01, "wall": "acrylic",
         "medium": "water"}  # fmt: skip
_DOME = {"shape": "dome", "position_m": [0.0, 0.0, 0.0], "decenter_m": [0.003, 0.0, 0.004],
         "radius_m": 0.055, "thickness_m": 0.005, "wall": "acrylic", "medium": "water"}  # fmt: skip
SYSTEMS: Mapping[str, tuple[float, tuple[Mapping[str, Any], ...]]] = {
    "tilted mirror": (1330.0, (_TILTED,)),
    "sphere": (1000.0, (_SPHERE,)),
    "cone": (340.0, (_CONE,)),
    "folded": (1000.0, _FOLDED),
    "flat port": (180.0, (_FLAT,)),
    "dome port": (180.0, (_DOME,)),
}  # by name: focal length in pixels, and surfaces as in an optics file


def validation_systems() -> dict[str, OpticalSystem]:
    """Optical systems by name: the surfaces of `examples/optics` in front of a pinhole."""
    systems = {}
    for name, (focal_length_px, surfaces) in SYSTEMS.items():
        camera = {
            "model": "perspective",
            "width_px": SIZE_PX,
            "height_px": SIZE_PX,
            "focal_length_px": focal_length_px,
        }
        systems[name] = parse_optics({"camera": camera, "surfaces": list(surfaces)}, name)
    return systems
