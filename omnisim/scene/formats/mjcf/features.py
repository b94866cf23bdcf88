"""Features of MuJoCo's models.

MuJoCo compiles the model and refuses what it does not know. Parts of the compiled model have names
with a space.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any
from xml.etree.ElementTree import Element

import mujoco

from omnisim.scene.formats.features import Feature, Support

_APPLIED, _LEFT_OUT, _IGNORED = Support.APPLIED, Support.LEFT_OUT, Support.IGNORED


def _exceeds_zero(attribute: str) -> Any:
    return lambda element: any(
        one not in ("0", "0.0") for one in element.get(attribute, "").split()
    )


def _is_textured(element: Element) -> bool:
    return bool(element.get("texture"))


MJCF_FEATURES = (
    Feature("worldbody, body, frame, replicate, composite, flexcomp, attach, include, model", _APPLIED, "compiled by MuJoCo"),
    Feature(
        "geom, hfield, mesh", _APPLIED,
        "plane, hfield, sphere, capsule, ellipsoid, cylinder, box, mesh; sdf as its mesh; groups 0 "
        "to 2; infinite planes end where MuJoCo's cameras do, at 100 m at least",
    ),
    Feature("skin, flex, deformable, bone", _APPLIED, "as bent in the first pose, without lines of `flex`"),
    Feature("joint, freejoint, key, keyframe, @*", _APPLIED, "the first keyframe, or the initial pose"),
    Feature(
        "material, texture, layer, asset", _APPLIED,
        "rgba, 2d and cube textures with `texrepeat` and `texuniform`, metallic, roughness, "
        "emission; roles normal, orm, emissive; `reflectance` of opaque planes, as a mirror of this "
        "reflectance at all angles, of the sky too, and the rest of the light for the color, to "
        "which MuJoCo adds the mirrored geoms",
    ),
    Feature(
        "material@specular, material@shininess", _LEFT_OUT,
        "highlights of `specular` and `shininess` are not drawn", "material", _exceeds_zero("specular"),
    ),
    Feature("light, headlight", _APPLIED, "directional, spot, point; headlight as ambient light"),
    Feature("light@texture", _LEFT_OUT, "lights of images are not drawn", "light", _is_textured),
    Feature("map@haze, rgba@haze", _LEFT_OUT, "haze is not drawn", "setting"),
    Feature("camera", _APPLIED, "its pose and pinhole lens: `--at-camera`; the start without a TOML"),
    Feature("visible sites", _LEFT_OUT, "sites are not drawn", "site"),
    Feature("visible tendons", _LEFT_OUT, "tendons are not drawn", "tendon"),
    Feature("default, compiler, option, size, statistic, visual, visual/*, lengthrange, flag, global, quality, map, scale, rgba", _APPLIED, "read by MuJoCo"),
    Feature(
        "site, spatial, fixed, tendon, inertial, contact, pair, exclude, equality, actuator, "
        "sensor, custom, extension, plugin, joint/*", _IGNORED,
        "they show nothing, but for sites and tendons",
    ),
)  # fmt: skip


def drawn_parts(model: mujoco.MjModel, groups: Collection[int]) -> Iterator[tuple[str, int]]:
    """Sites and spatial tendons that MuJoCo draws."""
    for site in range(model.nsite):
        if int(model.site_group[site]) in groups and model.site_rgba[site, 3] > 0.0:
            yield "visible sites", site
    wraps = {int(model.tendon_adr[one]): one for one in range(model.ntendon)}
    for first, tendon in wraps.items():
        is_spatial = int(model.wrap_type[first]) != mujoco.mjtWrap.mjWRAP_JOINT
        is_visible = int(model.tendon_group[tendon]) in groups and model.tendon_rgba[tendon, 3] > 0
        if is_spatial and is_visible:
            yield "visible tendons", tendon
