"""Spheres of varied roughness and metalness, by omnisim and by Mitsuba's path tracer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Bytes, Floats, Floats32, Ints
from omnisim.core.poses import pose
from omnisim.core.srgb import srgb8_from_linear
from omnisim.plots.style import gallery
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.scene.light.environment import Environment, map_directions
from omnisim.scene.model import Light, Lighting, LightKind
from omnisim.validation import material_chart
from omnisim.validation.fixture import Fixture

BOUND = 2.0  # mean of CIEDE2000; 1 is just noticeable side by side
WIDTH_PX = 165
_SAMPLES, _QUICK_SAMPLES = 100, 36
_SHOWN_FACTOR = 25  # gray levels per unit of CIEDE2000
# Sharma, Wu and Dalal, "The CIEDE2000 color-difference formula", 2005; CIE 15 (L*a*b*); and
# IEC 61966-2-1 (sRGB).
_XYZ_FROM_RGB = np.array((
    (0.4124564, 0.3575761, 0.1804375),
    (0.2126729, 0.7151522, 0.0721750),
    (0.0193339, 0.1191920, 0.9503041),
))  # fmt: skip
_WHITE = _XYZ_FROM_RGB.sum(axis=1)
_CHROMA7 = 25.0**7  # a constant of CIEDE2000


def check(fixture: Fixture, title: str) -> Section:
    """Render the chart with both renderers in each light, and compare colors."""
    images: dict[str, Bytes] = {}
    measures, rows = [], []
    samples = _QUICK_SAMPLES if fixture.is_quick else _SAMPLES
    for name, lighting in lightings().items():
        ours, traced, spheres = charts(lighting, samples, fixture.device)
        difference = ciede2000(lab_from_linear(ours), lab_from_linear(traced))
        shown = spheres >= 0
        mean = float(difference[shown].mean())
        measures.append(Measure(f"{name}: mean CIEDE2000", mean, "", BOUND))
        for row, roughness in enumerate(material_chart.ROUGHNESS):
            columns = len(material_chart.METALLIC)
            means = [difference[spheres == columns * row + i].mean() for i in range(columns)]
            rows.append((name, f"{roughness:g}", *(f"{mean:.2f}" for mean in means)))
        gray = np.clip(_SHOWN_FACTOR * difference * shown, 0, 255).astype(np.uint8)
        images |= {
            f"{name}, omnisim": srgb8_from_linear(np.clip(ours * shown[..., None], 0.0, 1.0)),
            f"{name}, Mitsuba": srgb8_from_linear(np.clip(traced, 0.0, 1.0)),
            f"{name}, difference": np.repeat(gray[..., None], 3, axis=2),
        }
    return Section(
        title,
        "Spheres of glTF's materials against Mitsuba's principled BSDF: roughness from top to "
        "bottom, metalness from left to right. Mitsuba's shadowing and masking of facets "
        "are uncorrelated. Its dielectrics reflect by Fresnel's exact equations. Its diffuse light "
        "is Disney's, not Lambert's, and is not reduced by the reflected light.",
        measures,
        (ResultTable("Mean CIEDE2000 of each sphere, by metalness",
                     ("light", "roughness", *(f"{share:g}" for share in material_chart.METALLIC)),
                     tuple(rows)),),
        [CaptionedFigure("materials", gallery(images, 3),
                         f"Charts by both; {_SHOWN_FACTOR} levels of gray are a difference of 1.")],
    )  # fmt: skip


def lightings() -> dict[str, Lighting]:
    """Lights of the charts: one lamp, uniform ambient light, and a map with a bright disc."""
    toward = np.array([0.6, -0.5, -0.62]) / np.linalg.norm([0.6, -0.5, -0.62])
    lamp = Light(LightKind.DIRECTIONAL, (1.0, 1.0, 1.0), 0.8, direction=toward)
    dark = (0.0, 0.0, 0.0)
    directions, _ = map_directions(128, 256)
    colors = 0.5 + 0.3 * directions + 0.15 * np.sin(6.0 * directions[..., [1, 2, 0]])
    disc = np.array([-0.5, -0.6, 0.7]) / np.linalg.norm([-0.5, -0.6, 0.7])
    colors[directions @ disc > 0.95] = 8.0
    environment = Environment(colors.astype(np.float32))
    return {
        "a lamp": Lighting(dark, (lamp,)),
        "even light": Lighting((0.8, 0.8, 0.8), ()),
        "an environment map": Lighting(dark, (), environment=environment),
    }


def charts(lighting: Lighting, samples: int, device: int | None) -> tuple[Floats32, Floats32, Ints]:
    """Linear charts (height, width, 3) by omnisim and Mitsuba, and each pixel's sphere index."""
    from omnisim.validation.oracles.mitsuba_materials import trace_sphere  # of an extra

    # Mitsuba traces each sphere alone
    camera = replace(material_chart.camera().resized(WIDTH_PX), reflection_probes=0)
    model = camera.model
    assert isinstance(model, PerspectiveCamera)
    scene = material_chart.chart(lighting.with_shadows(False))
    with open_sensor(scene, camera, device=device) as renderer:
        linear = renderer.render(pose((0.0, 0.0, 0.0)), linear=True).linear
    assert linear is not None
    ours = linear[..., :3]
    traced = np.zeros_like(ours)
    spheres = material_chart.sphere_of_pixels(model)
    for number, center_m in enumerate(material_chart.centers_m()):
        rows, columns = np.nonzero(spheres == number)
        top, left = int(rows.min()), int(columns.min())
        height, width = int(rows.max()) - top + 1, int(columns.max()) - left + 1
        part = trace_sphere(
            scene.materials[number], center_m, material_chart.RADIUS_M, scene.lighting, model,
            (left, top, width, height), samples,
        )  # fmt: skip
        traced[top : top + height, left : left + width] = part
    traced[spheres < 0] = 0.0
    return ours, traced, spheres


def lab_from_linear(rgb: NDArray[np.floating]) -> Floats:
    """L*a*b* (..., 3) of linear sRGB (..., 3), clipped to [0, 1]."""
    shares = np.clip(rgb, 0.0, 1.0) @ _XYZ_FROM_RGB.T / _WHITE
    roots = np.where(
        shares > 216.0 / 24389.0, np.cbrt(shares), (24389.0 / 27.0 * shares + 16) / 116
    )
    x, y, z = np.moveaxis(roots, -1, 0)
    return np.stack((116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)), axis=-1)


def ciede2000(first: Floats, second: Floats) -> Floats:
    """CIEDE2000 color difference ΔE₀₀ (...) between two arrays of L*a*b* colors (..., 3)."""
    (l1, a1, b1), (l2, a2, b2) = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    chroma7 = (0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))) ** 7
    stretch = 1.5 - 0.5 * np.sqrt(chroma7 / (chroma7 + _CHROMA7))
    c1, c2 = np.hypot(a1 * stretch, b1), np.hypot(a2 * stretch, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a * stretch)) % 360.0 for a, b in ((a1, b1), (a2, b2)))
    is_gray = c1 * c2 == 0.0
    turn = np.where(is_gray, 0.0, (h2 - h1 + 180.0) % 360.0 - 180.0)
    hue_step = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(0.5 * turn))
    far_apart = np.abs(h1 - h2) > 180.0
    hue = np.where(is_gray, h1 + h2, 0.5 * (h1 + h2) + np.where(far_apart, 180.0, 0.0))
    light, chroma = 0.5 * (l1 + l2), 0.5 * (c1 + c2)
    weight: Floats = 1.0 + sum(
        part * np.cos(np.radians(times * hue + phase_deg))
        for part, times, phase_deg in (
            (-0.17, 1.0, -30.0), (0.24, 2.0, 0.0), (0.32, 3.0, 6.0), (-0.20, 4.0, -63.0)
        )
    )  # fmt: skip
    off = (light - 50.0) ** 2
    of_light = (l2 - l1) / (1.0 + 0.015 * off / np.sqrt(20.0 + off))
    of_chroma = (c2 - c1) / (1.0 + 0.045 * chroma)
    of_hue = hue_step / (1.0 + 0.015 * chroma * weight)
    blue = np.radians(60.0 * np.exp(-(((hue - 275.0) / 25.0) ** 2)))
    rotation = -2.0 * np.sqrt(chroma**7 / (chroma**7 + _CHROMA7)) * np.sin(blue)
    squared = of_light**2 + of_chroma**2 + of_hue**2 + rotation * of_chroma * of_hue
    return np.sqrt(np.maximum(squared, 0.0))
