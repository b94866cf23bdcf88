"""Point spread and lateral color over the field, from slanted edges in any number of images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.optics.boards.board_corners import BoardCorners
from omnisim.core.errors import MeasurementError
from omnisim.measurement.quantity import Quantity, Unobservable
from omnisim.measurement.sharpness.edge_fit import Flaw, UnusableEdge
from omnisim.measurement.sharpness.edge_images import linear_light
from omnisim.measurement.sharpness.edge_lines import board_edges, find_edges
from omnisim.measurement.sharpness.field_curves import FieldCurves, field_curves
from omnisim.measurement.sharpness.slanted_edge import GREEN, EdgeSharpness, measure_edge
from omnisim.rendering.camera.degradations import ChromaticAberration, Encoding, PointSpread

MAX_ASYMMETRY = 0.02  # mean over the edges; gamma-encoded values have 0.03 and more
_SIGMAS = 4.0
RINGS = 3
_REMEDY = "photograph slanted black and white edges, such as a turned chessboard"


@dataclass(frozen=True, eq=False)
class MeasuredSharpness:
    """Sharpness of a camera.

    Attributes:
        point_spread: widths over the field; None: the optics are sharper than the pixels show.
        chromatic_aberration: lateral color; None: not measured.
        quantities: measured quantities with their standard deviations.
        unobservable: quantities that the images do not determine.
        edges: measured edges.
        flaws: number of unusable edges for each reason.
        size_px: width and height of the images.
        center_px: (u, v) of the center of the radii.
    """

    point_spread: PointSpread | None
    chromatic_aberration: ChromaticAberration | None
    quantities: tuple[Quantity, ...]
    unobservable: tuple[Unobservable, ...]
    edges: tuple[EdgeSharpness, ...]
    flaws: dict[Flaw, int]
    size_px: tuple[int, int]
    center_px: tuple[float, float]


def measure_sharpness(
    images: Iterable[NDArray[Any]],
    *,
    boards: Sequence[BoardCorners | None] | None = None,
    center_px: tuple[float, float] | None = None,
    encoding: Encoding | None = None,
    names: Sequence[str] | None = None,
    edges_only: Callable[[EdgeSharpness], bool] = lambda _: True,
) -> MeasuredSharpness:
    """Measure the sharpness of a camera.

    Args:
        images: (height, width) or (height, width, 3) integers, or floats with 1: white; only one
            image is in memory at a time.
        boards: corners of a board of squares in each image; None: all straight edges are used.
        center_px: (u, v) of the optical axis; None: the middle of the image.
        encoding: encoding of the values; None: linear, which is checked.
        names: names of the images in messages.
        edges_only: function that returns True for the edges to use.

    Raises:
        MeasurementError: no images, several sizes, no usable edges, or values that are not linear.
    """
    edges: list[EdgeSharpness] = []
    flaws: Counter[Flaw] = Counter()
    size_px: tuple[int, int] | None = None
    for number, pixels in enumerate(images):
        name = names[number] if names else f"image {number}"
        height, width = pixels.shape[:2]
        if size_px not in (None, (width, height)):
            expected = f"expected images of one size, {size_px[0]} × {size_px[1]} px"
            raise MeasurementError(f"{name}: {expected}, got {width} × {height} px")
        size_px = width, height
        light, clipped = linear_light(pixels, encoding, name)
        board = boards[number] if boards is not None and number < len(boards) else None
        if boards is None:
            lines = find_edges(light[..., GREEN if light.shape[2] == 3 else 0])
        else:
            lines = board_edges(board) if board is not None else []
        for line in lines:
            try:
                edges.append(measure_edge(light, clipped, line, number))
            except UnusableEdge as reason:
                flaws[reason.args[0]] += 1
    if size_px is None:
        raise MeasurementError(f"expected images of edges, got none: {_REMEDY}")
    edges = [edge for edge in edges if edges_only(edge)]
    _check_edges(edges, flaws, names[0] if names else "images")
    if encoding is None:
        _check_linear(edges)
    if center_px is None:
        center_px = 0.5 * (size_px[0] - 1), 0.5 * (size_px[1] - 1)
    curves = field_curves(edges, size_px, center_px)
    return MeasuredSharpness(
        point_spread=curves.point_spread,
        chromatic_aberration=curves.chromatic_aberration,
        quantities=(*_ring_quantities(edges, curves), *curves.quantities),
        unobservable=tuple(curves.unobservable),
        edges=tuple(edges),
        flaws=dict(flaws),
        size_px=size_px,
        center_px=center_px,
    )


def _check_edges(edges: Sequence[EdgeSharpness], flaws: Counter[Flaw], first: str) -> None:
    if edges:
        return
    if not flaws:
        raise MeasurementError(f"{first} and others: no edges found: {_REMEDY}")
    flaw, count = flaws.most_common(1)[0]
    raise MeasurementError(
        f"{first} and others: none of {flaws.total()} edges is usable; {count} are {flaw.value}"
    )


def _check_linear(edges: Sequence[EdgeSharpness]) -> None:
    """Reject edges whose dark half is narrower or wider than the bright one: not linear."""
    asymmetries = np.array([edge.asymmetry for edge in edges])
    middle = float(np.median(asymmetries))
    spread = 1.4826 * float(np.median(np.abs(asymmetries - middle)))
    sigma = max(spread / np.sqrt(len(edges)), 0.002 if len(edges) > 1 else np.inf)
    if abs(middle) > MAX_ASYMMETRY and abs(middle) > _SIGMAS * sigma:
        raise MeasurementError(
            f"images: the edges are {100.0 * abs(middle):.1f} % wider on one half, as in "
            "gamma-encoded values: save linear (raw) images, or give their response, such as srgb "
            "or 2.2 (1: linear)"
        )


def _ring_quantities(edges: Sequence[EdgeSharpness], curves: FieldCurves) -> list[Quantity]:
    """Mean MTF50 and mean 10-90 % edge rise in each of three rings of equal width."""
    ends = np.linspace(0.0, float(curves.radii_px.max()) + 1e-9, RINGS + 1)
    quantities = []
    for first, last in pairwise(ends.tolist()):
        ring = [
            edge
            for edge, radius in zip(edges, curves.radii_px, strict=True)
            if first <= radius < last
        ]
        if not ring:
            continue
        place, basis = f"{first:.0f}-{last:.0f} px", f"{len(ring)} edges"
        mtf50 = [(edge.mtf50, edge.mtf50_sigma) for edge in ring]
        rise = [(edge.rise_px, edge.rise_sigma_px) for edge in ring]
        quantities.append(_mean(f"mtf50 {place}", mtf50, "cycles/px", basis))
        quantities.append(_mean(f"rise {place}", rise, "px", basis))
    return quantities


def _mean(name: str, measured: list[tuple[float, float]], unit: str, basis: str) -> Quantity:
    """Mean of measured values, with a standard deviation from their noise or scatter, the larger.

    Args:
        name, unit, basis: attributes of the quantity.
        measured: values, each with its standard deviation.
    """
    values, sigmas = np.array(measured).T
    scatter = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    sigma = max(scatter, float(np.sqrt(np.mean(sigmas**2)))) / np.sqrt(len(values))
    return Quantity(name, float(values.mean()), float(sigma), unit, basis)
