"""The omnidirectional camera seen from outside: a camera that looks up at a mirror in a glass tube.

Shapes are about the effective viewpoint, z up, meters; the sensor's mirror says how large they are.
What is above the mirror's rim stays above the cone of the rim about the effective viewpoint, so
nothing of the holder could be in the sensor's picture.
"""

from __future__ import annotations

import numpy as np

from omnisim.cameras.mirrors import HyperbolicMirror
from scenes.modeling.geometry import Patch, bar, join, lathe
from scenes.modeling.palette import Palette
from scenes.modeling.pbr_materials import Color, see_through
from scenes.modeling.prisms import block
from scenes.modeling.stage import Model, Stage

GLASS = see_through("glass", (0.75, 0.85, 0.90, 0.14), roughness=0.05)
COLORS: dict[str, Color] = {  # sRGB
    "camera_black": (0.13, 0.13, 0.14),
    "lens": (0.12, 0.12, 0.26),
    "silver": (0.78, 0.79, 0.81),
}
SEGMENTS = 18
TUBE_RADIUS = 0.017
LENS_RADIUS = 0.0125
MIRROR_EDGE = 0.001  # thickness of the mirror at its rim
HOUSING = (0.056, 0.056, 0.050)
LENS_LENGTH = 0.015  # from the housing to the pinhole


def place_camera(
    stage: Stage,
    palette: Palette,
    mirror: HyperbolicMirror,
    viewpoint: tuple[float, float, float],
    deck_z: float,
) -> None:
    """Place the nodes camera_body, glass_tube, mast, mirror and mirror_cap on a robot.

    Args:
        stage: has the materials "paint", which shows the palette, and "glass".
        palette: has `COLORS`.
        mirror: of the sensor.
        viewpoint: the effective viewpoint on the robot.
        deck_z: height of the plate that the mast stands on.
    """
    cap_z = -mirror.rim_height_m + 3 * MIRROR_EDGE
    housing_z = -mirror.c_m - LENS_LENGTH
    parts = {
        "camera_body": _camera_body(palette, -mirror.c_m, housing_z),
        "mast": _mast(palette, deck_z - viewpoint[2], housing_z - HOUSING[2]),
        "mirror": palette.paint("silver", _mirror(mirror, cap_z)),
        "mirror_cap": _cap(palette, cap_z),
        "glass_tube": _rod(TUBE_RADIUS, -mirror.c_m - 0.003, cap_z + 0.001),
    }
    for name, patch in parts.items():
        material = "glass" if name == "glass_tube" else "paint"
        stage.place(name, Model(name, material, patch.shifted(*viewpoint)))


def _mirror(mirror: HyperbolicMirror, top: float) -> Patch:
    """The reflecting surface, facing down, and a stem that holds it."""
    rim = mirror.rim_radius_m
    radius = np.linspace(0, rim, 7)
    # The mirror's own z points down, towards the pinhole.
    surface = np.column_stack([radius, -mirror.height_from_radius_m(radius)])
    back = surface[-1, 1] + MIRROR_EDGE
    stem = 0.6 * rim
    return lathe([*surface, (rim, back), (stem, back), (stem, top), (0.0, top)], SEGMENTS)


def _cap(palette: Palette, bottom: float) -> Patch:
    reach = TUBE_RADIUS + 0.0025
    profile = [(0.0, 0.0), (reach, 0.0), (reach, 0.009), (reach - 0.004, 0.013), (0.0, 0.014)]
    cap = lathe(profile, SEGMENTS).shifted(z=bottom)
    return palette.paint("camera_black", cap)


def _camera_body(palette: Palette, pinhole: float, housing_top: float) -> Patch:
    """A housing with the lens on it, whose glass is at the pinhole; a collar holds the tube."""
    middle = (0, 0, housing_top - HOUSING[2] / 2)
    collar = TUBE_RADIUS + 0.003
    ring = LENS_RADIUS + 0.0015
    foot = housing_top - 0.002
    holder = [(0.0, foot), (collar, foot), (collar, pinhole - 0.001), (0.0, pinhole - 0.001)]
    lens = [(0.0, foot), (ring, foot), (ring, pinhole + 0.002), (LENS_RADIUS, pinhole + 0.002)]
    lens.append((LENS_RADIUS, pinhole - 0.0005))
    glass = [lens[-1], (0.6 * LENS_RADIUS, pinhole - 0.0001), (0.0, pinhole)]
    bolts = [
        _rod(0.0025, housing_top - 0.001, housing_top + 0.001, 8).shifted(x, y)
        for x in (-0.0225, 0.0225)
        for y in (-0.0225, 0.0225)
    ]
    return join(
        [
            palette.paint("camera_black", block(HOUSING, middle), lathe(lens, SEGMENTS)),
            palette.paint("lens", lathe(glass, SEGMENTS)),
            palette.paint("silver", lathe(holder, SEGMENTS), *bolts),
        ]
    )


def _mast(palette: Palette, deck: float, top: float) -> Patch:
    """Column on a flange, a plate under the camera, and the camera's cable along it."""
    flange = lathe(
        [
            (0.0, deck),
            (0.036, deck),
            (0.036, deck + 0.006),
            (0.016, deck + 0.010),
            (0.016, deck + 0.022),
            (0.0125, deck + 0.024),
            (0.0125, top - 0.004),
            (0.0, top - 0.004),
        ],
        16,
    )
    plate = block((0.062, 0.062, 0.005), (0, 0, top - 0.0025), 0.001)
    cable = bar((-0.0165, 0, deck), (-0.0165, 0, top - 0.004), 0.003, 8)
    return join([palette.paint("silver", flange, plate), palette.paint("camera_black", cable)])


def _rod(radius: float, bottom: float, top: float, segments: int = SEGMENTS) -> Patch:
    return lathe([(0.0, bottom), (radius, bottom), (radius, top), (0.0, top)], segments)
