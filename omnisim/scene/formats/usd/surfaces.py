"""Materials from UsdPreviewSurface, or else OmniPBR, within the scene's material model."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdShade

from omnisim.scene.formats.imported_scene import Omissions
from omnisim.scene.formats.usd.shading import (
    CHANNELS,
    OMNI_PBR_NAMES,
    Affine,
    Inputs,
    ShaderInput,
    TextureFiles,
    TextureSource,
    read_omni_pbr,
)
from omnisim.scene.parts import AlphaMode, Material, Texture
from omnisim.scene.surface_reflectance import MAX_PANE_ROUGHNESS

_PREVIEW = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")
_NOT_DRAWN = {"displacement": 0.0, "useSpecularWorkflow": 0.0}


class Appearance(NamedTuple):
    """Material and the vertex data that it requires.

    Attributes:
        material: scene material; its sides are set by each mesh.
        uv: texture that determines the meshes' texture coordinates; None: no texture.
        color_primvar, opacity_primvar: primvars of the base color and opacity; empty: none.
    """

    material: Material
    uv: TextureSource | None = None
    color_primvar: str = ""
    opacity_primvar: str = ""


class Surfaces:
    """Appearances of a stage's materials, each read once."""

    def __init__(self, files: TextureFiles, time: Usd.TimeCode, notices: Omissions):
        self._files, self._time, self._notices = files, time, notices
        self._known: dict[str, Appearance | None] = {}

    def read(self, material: UsdShade.Material) -> Appearance | None:
        """Appearance of a material; None: no supported surface."""
        path = str(material.GetPath())
        if path not in self._known:
            self._known[path] = self._read(material)
        return self._known[path]

    def _read(self, material: UsdShade.Material) -> Appearance | None:
        name = material.GetPrim().GetName()
        for context in ("", "mtlx"):
            shader = material.ComputeSurfaceSource(context)[0]
            if shader and shader.GetShaderId() in _PREVIEW:
                inputs = Inputs(shader, self._time, self._notices)
                return _PreviewSurface(name, inputs, self._files, self._notices).read()
        shader = material.ComputeSurfaceSource("mdl")[0]
        if shader and shader.GetSourceAssetSubIdentifier("mdl") in OMNI_PBR_NAMES:
            inputs = Inputs(shader, self._time, self._notices)
            return Appearance(*read_omni_pbr(name, inputs, self._files, self._notices))
        self._notices.add(
            f"material {name!r} has no UsdPreviewSurface: its meshes have their display color"
        )
        return None


class _PreviewSurface:
    """Reader of one UsdPreviewSurface.

    Source: the UsdPreviewSurface specification of OpenUSD, version 2.6.
    """

    def __init__(self, name: str, inputs: Inputs, files: TextureFiles, notices: Omissions):
        self._name, self._inputs, self._files, self._notices = name, inputs, files, notices
        self._uv: TextureSource | None = None  # determines the meshes' texture coordinates

    def read(self) -> Appearance:
        """Read all inputs of the surface."""
        for key, neutral in _NOT_DRAWN.items():
            if self._inputs.get(key).differs(neutral):
                self._notices.count(f"{key} is not drawn", "material")
        diffuse, opacity = self._inputs.get("diffuseColor"), self._inputs.get("opacity")
        material = self._base(Material(self._name, specular=1.0), diffuse, opacity)
        material = self._with_normals(self._with_gloss(material))
        material = self._with_emission(self._with_occlusion(material))
        if self._is_pane(material, opacity):
            material = _pane(material)
        return Appearance(material, self._uv, diffuse.primvar, opacity.primvar)

    def _base(self, material: Material, diffuse: ShaderInput, opacity: ShaderInput) -> Material:
        """Material with its base color and alpha."""
        color, texture = diffuse.color((0.18, 0.18, 0.18)), None
        if diffuse.primvar:
            color = (1.0, 1.0, 1.0)
        if diffuse.texture is not None:
            texture = self._texture(diffuse.texture)
            color = diffuse.texture.fallback[:3] if texture is None else diffuse.texture.scale[:3]
            if texture is not None and any(diffuse.texture.bias[:3]):
                self._notices.count("bias of a texture of colors is not drawn", "material")
        alpha = 1.0 if opacity.primvar else opacity.number(1.0)
        if opacity.texture is not None:
            planes = {3: (opacity.texture, opacity.channel)}
            base = None if texture is None else diffuse.texture
            texture = self._files.packed(planes, base, self._name)
            self._uv = self._uv or opacity.texture
            alpha = 1.0 if texture else opacity.texture.fallback[CHANNELS.get(opacity.channel, 0)]
        threshold = self._inputs.get("opacityThreshold").number(0.0)
        mode = AlphaMode.MASK if threshold > 0.0 else AlphaMode.BLEND
        if threshold <= 0.0 and alpha >= 1.0 and not (opacity.texture or opacity.primvar):
            mode = AlphaMode.OPAQUE
        return replace(
            material,
            base_color=(*color, alpha),
            texture=texture,
            alpha_mode=mode,
            alpha_cutoff=threshold if threshold > 0.0 else 0.5,
        )

    def _with_gloss(self, material: Material) -> Material:
        values = {"roughness": 0.5, "metallic": 0.0, "ior": 1.5, "clearcoat": 0.0}
        values |= {"clearcoatRoughness": 0.01}
        inputs = {key: self._inputs.get(key) for key in values}
        roughness, metallic, ior, clearcoat, clearcoat_roughness = (
            one.number(values[key]) for key, one in inputs.items()
        )
        planes = {
            channel: (one.texture, one.channel)
            for channel, one in ((1, inputs["roughness"]), (2, inputs["metallic"]))
            if one.texture is not None
        }
        packed = self._packed(planes)
        if packed is not None:  # factors multiply the map, so mapped ones become 1
            roughness = 1.0 if 1 in planes else roughness
            metallic = 1.0 if 2 in planes else metallic
        return replace(
            material,
            roughness=roughness, metallic=metallic, ior=ior, clearcoat=clearcoat,
            clearcoat_roughness=clearcoat_roughness, metallic_roughness_map=packed,
        )  # fmt: skip

    def _is_pane(self, material: Material, opacity: ShaderInput) -> bool:
        """True for blended materials of one color that are smooth and clear: panes of glass."""
        is_plain = material.texture is None and material.metallic_roughness_map is None
        is_plain &= material.normal_map is None and not opacity.primvar and not opacity.texture
        is_plain &= not self._inputs.get("diffuseColor").primvar
        is_smooth = material.metallic == 0.0 and material.roughness <= MAX_PANE_ROUGHNESS
        is_faded = str(self._inputs.get("opacityMode").value or "transparent") == "presence"
        return material.is_blended and is_plain and is_smooth and not is_faded

    def _with_normals(self, material: Material) -> Material:
        source = self._inputs.get("normal").texture
        texture = None if source is None else self._files.normals(source, self._name)
        if source is None or texture is None:
            return material
        return replace(material, normal_map=self._fitted(texture, source))

    def _with_occlusion(self, material: Material) -> Material:
        occlusion = self._inputs.get("occlusion")
        planes = {} if occlusion.texture is None else {0: (occlusion.texture, occlusion.channel)}
        return replace(material, occlusion_map=self._packed(planes))

    def _with_emission(self, material: Material) -> Material:
        emissive = self._inputs.get("emissiveColor")
        if emissive.texture is None:
            return replace(material, emissive=emissive.color((0.0, 0.0, 0.0)))
        texture = self._texture(emissive.texture)
        color = emissive.texture.fallback[:3] if texture is None else emissive.texture.scale[:3]
        return replace(material, emissive=color, emissive_map=texture)

    def _packed(self, planes: dict[int, tuple[TextureSource, str]]) -> Texture | None:
        """Linear texture packed from channels of other textures."""
        if not planes:
            return None
        packed = self._files.packed(planes, None, self._name)
        fitted = None if packed is None else self._fitted(packed, next(iter(planes.values()))[0])
        return None if fitted is None else replace(fitted, is_linear=True)

    def _texture(self, source: TextureSource) -> Texture | None:
        texture = self._files.texture(source, self._name)
        return None if texture is None else self._fitted(texture, source)

    def _fitted(self, texture: Texture, source: TextureSource) -> Texture | None:
        """Texture placed by the meshes' coordinates, those of the material's first texture."""
        self._uv = self._uv or source
        if source.primvar != self._uv.primvar:
            self._notices.count("texture for further coordinates is not drawn", "material")
            return None
        transform = _relative(source.uv_transform, self._uv.uv_transform)
        if transform == texture.uv_transform:
            return texture
        return replace(texture, uv_transform=transform)


def _pane(material: Material) -> Material:
    """Thin pane of a blended material.

    The specification passes the share 1 − opacity of the light, whatever the color, and has a body
    of opacity · diffuse color, below a full gloss. A pane tints both by one base color: exact for
    gray, else the light is tinted as far as the body is visible.
    """
    *diffuse, opacity = material.base_color
    opacity = min(max(opacity, 0.0), 1.0)
    red, green, blue = (1.0 - opacity + opacity * one for one in diffuse)
    transmission = (1.0 - opacity) / max((red + green + blue) / 3.0, 1e-6)
    return replace(
        material,
        base_color=(red, green, blue, 1.0),
        transmission=min(transmission, 1.0),
        alpha_mode=AlphaMode.OPAQUE,
    )


def _relative(target: Affine, applied: Affine) -> Affine:
    """Transform from coordinates transformed by `applied` to those transformed by `target`."""
    if target == applied:
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    full = [np.vstack((np.array(one), (0.0, 0.0, 1.0))) for one in (target, applied)]
    if abs(np.linalg.det(full[1])) < 1e-12:
        return target
    product: NDArray[np.float64] = full[0] @ np.linalg.inv(full[1])
    (a, b, c), (d, e, f) = product[:2].tolist()
    return (a, b, c), (d, e, f)
