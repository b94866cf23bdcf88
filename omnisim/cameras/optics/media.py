"""Refractive indices of media."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Literal

from pydantic import Field

from omnisim.cameras.camera import ParameterValue
from omnisim.core.errors import OpticsError, did_you_mean
from omnisim.core.files.parameters import described

MAX_INDEX = 5.0
Primary = Literal["R", "G", "B"]
Index = Annotated[float, Field(strict=True, ge=1.0, le=MAX_INDEX)]
Medium = Annotated[
    Literal["vacuum", "air", "water", "acrylic", "glass"] | Index | tuple[Index, Index, Index],
    described(
        "vacuum, air, water, acrylic, glass, a refractive index from 1 to 5, or those of R, G and B"
    ),
]

# Vacuum wavelengths: helium's d line, for which catalogs state indices, and the dominant
# wavelengths of sRGB's primaries.
D_LINE_UM = 0.58756
WAVELENGTHS_UM: Mapping[Primary, float] = {"R": 0.6114, "G": 0.5491, "B": 0.4642}


def _sellmeier(*terms: tuple[float, float]) -> Callable[[float], float]:
    """Index by wavelength in µm: n² = 1 + Σ bλ²/(λ² − c), with terms (b, c)."""

    def index(wavelength_um: float) -> float:
        squared = wavelength_um**2
        return math.sqrt(1.0 + sum(b * squared / (squared - c) for b, c in terms))

    return index


def _vacuum(wavelength_um: float) -> float:
    return 1.0


def _air(wavelength_um: float) -> float:
    """Index of standard air at 15 °C. Source: Ciddor, Applied Optics 35 (1996)."""
    wavenumber = wavelength_um**-2
    return 1.0 + 0.05792105 / (238.0185 - wavenumber) + 0.00167917 / (57.362 - wavenumber)


def _acrylic(wavelength_um: float) -> float:
    """Index of PMMA. Source: Beadie, Brindza, Flynn et al., Applied Optics 54 (2015)."""
    x = wavelength_um**2
    inverse = 2.3678e-2 / x - 4.2137e-3 / x**2 + 7.3417e-4 / x**3 - 4.5042e-5 / x**4
    return math.sqrt(2.1778 + 6.1209e-3 * x - 1.5004e-3 * x**2 + inverse)


MEDIA: Mapping[str, Callable[[float], float]] = {
    "vacuum": _vacuum,
    "air": _air,
    # fresh, 20 °C: Daimon & Masumura, Applied Optics 46 (2007)
    "water": _sellmeier(
        (0.5684027565, 5.101829712e-3),
        (0.1726177391, 1.821153936e-2),
        (0.02086189578, 2.620722293e-2),
        (0.1130748688, 10.69792721),
    ),
    "acrylic": _acrylic,
    # SCHOTT N-BK7, data sheet
    "glass": _sellmeier(
        (1.03961212, 0.00600069867), (0.231792344, 0.0200179144), (1.01046945, 103.560653)
    ),
}


def refractive_index(medium: Medium, color: Primary | None = None) -> float:
    """Refractive index of a medium.

    Args:
        medium: name in `MEDIA`, an index, or indices for R, G and B.
        color: "R", "G" or "B"; None: the index at the d line, or that for G of three.

    Raises:
        OpticsError: a medium or color is unknown, or an index is impossible.
    """
    if color is not None and color not in WAVELENGTHS_UM:
        raise OpticsError(f"color: expected R, G or B, got {color!r}")
    if isinstance(medium, tuple):
        if len(medium) != len(WAVELENGTHS_UM):
            raise OpticsError(f"medium: expected indices of R, G and B, got {len(medium)}")
        medium = medium[list(WAVELENGTHS_UM).index(color or "G")]
    if not isinstance(medium, str):
        if not 1.0 <= medium <= MAX_INDEX:
            raise OpticsError(f"medium: expected an index of 1 to {MAX_INDEX:g}, got {medium}")
        return medium
    if medium not in MEDIA:
        raise OpticsError(f"medium {medium!r}: {did_you_mean(medium, MEDIA)}")
    return MEDIA[medium](D_LINE_UM if color is None else WAVELENGTHS_UM[color])


def medium_parameter(medium: Medium) -> ParameterValue:
    """Medium as written in optics files."""
    return list(medium) if isinstance(medium, tuple) else medium
