"""Materials from UsdPreviewSurface, or else OmniPBR, within the scene's material model."""

from __future__ import annotations

import io
import math
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Ar, Sdf, Usd, UsdShade

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.files.sources import SourceReader
from omnisim.scene.formats.imported_scene import Omissions
from omnisim.scene.formats.resources import AssetResolver
from omnisim.scene.parts import AlphaMode, Material, Texture, Wrap
from omnisim.scene.surface_kind import MAX_PANE_ROUGHNESS
from omnisim.scene.textures import TextureStore, unreadable_image

_PREVIEW = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")
_NOT_DRAWN = {"displacement": 0.0, "useSpecularWorkflow": 0.0}


class Appearance(NamedTuple):
    """Material and the vertex data that it requires."""

    material: Material  # scene material; its sides are set by each mesh
    # texture that determines the meshes' texture coordinates; None: no texture
    uv: TextureSource | None = None
    # color_primvar, opacity_primvar: primvars of the base color and opacity; empty: none
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
        material = self._with_gloss(material)
        normal = self._inputs.get("normal").texture
        if normal is not None and (levels := self._files.normals(normal, self._name)) is not None:
            material = replace(material, normal_map=self._fitted(levels, normal))
        occlusion = self._inputs.get("occlusion")
        planes = {} if occlusion.texture is None else {0: (occlusion.texture, occlusion.channel)}
        material = replace(material, occlusion_map=self._packed(planes))
        emissive, texture = self._inputs.get("emissiveColor"), None
        color = emissive.color((0.0, 0.0, 0.0))
        if emissive.texture is not None:
            texture = self._texture(emissive.texture)
            source = emissive.texture
            color = source.fallback[:3] if texture is None else source.scale[:3]
        material = replace(material, emissive=color, emissive_map=texture)
        # blended materials of one color that are smooth and clear are panes of glass
        is_plain = material.texture is None and material.metallic_roughness_map is None
        is_plain &= material.normal_map is None and not opacity.primvar and not opacity.texture
        is_plain &= not diffuse.primvar
        is_smooth = material.metallic == 0.0 and material.roughness <= MAX_PANE_ROUGHNESS
        is_faded = str(self._inputs.get("opacityMode").value or "transparent") == "presence"
        if material.alpha_mode is AlphaMode.BLEND and is_plain and is_smooth and not is_faded:
            material = _pane(material)
        return Appearance(material, self._uv, diffuse.primvar, opacity.primvar)

    def _base(self, material: Material, diffuse: ShaderInput, opacity: ShaderInput) -> Material:
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
            shader_input.number(values[key]) for key, shader_input in inputs.items()
        )
        planes = {
            channel: (shader_input.texture, shader_input.channel)
            for channel, shader_input in ((1, inputs["roughness"]), (2, inputs["metallic"]))
            if shader_input.texture is not None
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
    red, green, blue = (1.0 - opacity + opacity * channel for channel in diffuse)
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
        return IDENTITY
    full = [np.vstack((np.array(matrix), (0.0, 0.0, 1.0))) for matrix in (target, applied)]
    if abs(np.linalg.det(full[1])) < 1e-12:
        return target
    product: Floats = full[0] @ np.linalg.inv(full[1])
    (a, b, c), (d, e, f) = product[:2].tolist()
    return (a, b, c), (d, e, f)


# Shading networks: values and connections, texture files, OmniPBR.

Affine = tuple[tuple[float, float, float], tuple[float, float, float]]
Rgba = tuple[float, float, float, float]
Numbers = TypeVar("Numbers", bound=tuple[float, ...])
IDENTITY: Affine = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
_FLIP_V = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
_MAX_CHAIN = 20  # limit on nodes for texture coordinates, in case of a loop


class TextureSource(NamedTuple):
    """Texture of a shader."""

    path: str  # path in the stage
    resolved: str  # path of the file or package member; empty: not found
    primvar: str = "st"  # primvar with the texture coordinates
    uv_transform: Affine = IDENTITY  # (2, 3) affine transform of the coordinates, with v down
    # wrapping modes along s and t, named as in UsdUVTexture
    wraps: tuple[str, str] = ("useMetadata", "useMetadata")
    # scale, bias: RGBA; the value is the texture's times scale, plus bias
    scale: Rgba = (1.0, 1.0, 1.0, 1.0)
    bias: Rgba = (0.0, 0.0, 0.0, 0.0)
    fallback: Rgba = (0.0, 0.0, 0.0, 1.0)  # RGBA in place of an unreadable file


class ShaderInput(NamedTuple):
    """Shader input: a value, a texture or a primvar."""

    value: object = None  # usd-core value; None: no value
    texture: TextureSource | None = None  # connected texture; None: no texture
    channel: str = "r"  # channels of the texture: r, g, b, a or rgb
    primvar: str = ""  # name of a connected primvar; empty: no primvar

    def number(self, default: float) -> float:
        """Value as a finite number, or the default."""
        value = self.value
        is_number = isinstance(value, int | float) and math.isfinite(value)
        return float(value) if isinstance(value, int | float) and is_number else default

    def color(self, default: tuple[float, float, float]) -> tuple[float, float, float]:
        """Value as a linear color, or the default."""
        return numbers(self.value, default)

    def differs(self, neutral: float) -> bool:
        """True if the input differs from a value without effect on the image."""
        return self.texture is not None or bool(self.primvar) or self.number(neutral) != neutral


class Inputs:
    """Inputs of a shader by name."""

    def __init__(self, shader: UsdShade.Shader, time: Usd.TimeCode, notices: Omissions):
        self._shader, self._time, self._notices = shader, time, notices

    def get(self, name: str) -> ShaderInput:
        """Input by name; unconnected and without a value if it is missing."""
        attribute = _source(self._shader.GetInput(name))
        if attribute is None:
            return ShaderInput()
        node = _node(attribute)
        if node is None:
            return ShaderInput(attribute.Get(self._time))
        kind = str(node.GetShaderId() or "")
        if kind == "UsdUVTexture":
            channel = attribute.GetName().partition(":")[2]
            return ShaderInput(texture=self._texture(node), channel=channel)
        if kind.startswith("UsdPrimvarReader"):
            return ShaderInput(primvar=self._text(node, "varname"))
        self._notices.count(
            f"{name} of a shader {kind or 'without a name'} is not read", "material"
        )
        return ShaderInput()

    def pair(self, name: str, default: float) -> tuple[float, float]:
        """Value of two numbers, each with the same default."""
        return numbers(self.get(name).value, (default, default))

    def _texture(self, node: UsdShade.Shader) -> TextureSource:
        file = self._value(node, "file")
        path, resolved = "", ""
        if isinstance(file, Sdf.AssetPath):
            path, resolved = str(file.path), str(file.resolvedPath)
        primvar, transform = self._coordinates(node)
        wraps = self._text(node, "wrapS"), self._text(node, "wrapT")
        # a mirrored texture is stored next to its mirror image
        (a, b, c), (d, e, f) = (
            [x * (0.5 if wrap == "mirror" else 1.0) for x in row]
            for row, wrap in zip(transform, wraps, strict=True)
        )
        return TextureSource(
            path,
            resolved,
            primvar,
            ((a, b, c), (d, e, f)),
            wraps,
            numbers(self._value(node, "scale"), (1.0, 1.0, 1.0, 1.0)),
            numbers(self._value(node, "bias"), (0.0, 0.0, 0.0, 0.0)),
            numbers(self._value(node, "fallback"), (0.0, 0.0, 0.0, 1.0)),
        )

    def _coordinates(self, texture: UsdShade.Shader) -> tuple[str, Affine]:
        """Primvar of a texture's coordinates, and their transform with v down."""
        matrix, node, key = np.eye(3), texture, "st"
        for _ in range(_MAX_CHAIN):
            attribute = _source(node.GetInput(key))
            source_node = None if attribute is None else _node(attribute)
            if source_node is None:
                break
            node = source_node
            kind = str(node.GetShaderId() or "")
            if kind.startswith("UsdPrimvarReader"):
                flipped = _FLIP_V @ matrix @ _FLIP_V
                (a, b, c), (d, e, f) = flipped[:2].tolist()
                return self._text(node, "varname") or "st", ((a, b, c), (d, e, f))
            if kind != "UsdTransform2d":
                self._notices.count(f"texture coordinates of a shader {kind} are not read")
                break
            matrix, key = matrix @ self._transform(node), "in"
        return "st", IDENTITY

    def _transform(self, node: UsdShade.Shader) -> Floats:
        """Transform (3, 3) of a UsdTransform2d: scale, then rotation, then translation."""
        angle = math.radians(ShaderInput(self._value(node, "rotation")).number(0.0))
        scale = numbers(self._value(node, "scale"), (1.0, 1.0))
        shift = numbers(self._value(node, "translation"), (0.0, 0.0))
        cos, sin = math.cos(angle), math.sin(angle)
        rotation = np.array([[cos, -sin], [sin, cos]])
        matrix = np.eye(3)
        matrix[:2, :2] = rotation * scale
        matrix[:2, 2] = shift
        return matrix

    def _value(self, node: UsdShade.Shader, name: str) -> object:
        attribute = _source(node.GetInput(name))
        if attribute is None or _node(attribute) is not None:
            return None
        return attribute.Get(self._time)

    def _text(self, node: UsdShade.Shader, name: str) -> str:
        value = self._value(node, name)
        return value if isinstance(value, str) else ""


def _source(shader_input: UsdShade.Input) -> Usd.Attribute | None:
    """Attribute with an input's value, or the shader output connected to it; None: neither."""
    if not shader_input:
        return None
    attributes = UsdShade.Utils.GetValueProducingAttributes(shader_input)
    return attributes[0] if attributes else None


def _node(attribute: Usd.Attribute) -> UsdShade.Shader | None:
    """Shader with the given output attribute; None: the attribute is not an output."""
    if UsdShade.Utils.GetType(attribute.GetName()) != UsdShade.AttributeType.Output:
        return None
    return UsdShade.Shader(attribute.GetPrim())


def numbers(value: object, default: Numbers) -> Numbers:
    """Value as finite numbers, as many as in the default, or else the default."""
    if value is None or isinstance(value, str | int | float):
        return default
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.shape != (len(default),):
        return default
    values = tuple(array.astype(np.float64).tolist())
    return cast(Numbers, values) if np.isfinite(array).all() else default


# Textures of a stage, from files and package members, each decoded once.

CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
_WRAPS = {"clamp": Wrap.CLAMP_TO_EDGE, "black": Wrap.CLAMP_TO_EDGE}


class TextureFiles:
    """Textures by their sources; each unreadable one is reported once."""

    def __init__(self, assets: AssetResolver, textures: TextureStore, notices: Omissions):
        self._assets, self._textures, self._notices = assets, textures, notices
        self._images: dict[str, Image.Image | None] = {}
        self._packed: dict[object, Texture | None] = {}

    def texture(self, source: TextureSource, material: str) -> Texture | None:
        """Texture of a source, before its scale and bias; None: unreadable."""
        image = self._image(source)
        if image is None:
            return None
        for wrap in set(source.wraps) & {"black"}:
            self._notices.count(f"wrap mode {wrap}: the texture's edge is drawn", "texture")
        s, t = (_WRAPS.get(wrap, Wrap.REPEAT) for wrap in source.wraps)
        mirrored = (source.wraps[0] == "mirror", source.wraps[1] == "mirror")
        return self._textures.texture(image, material, (s, t), mirrored)

    def normals(self, source: TextureSource, material: str) -> Texture | None:
        """Normal map with glTF's encoding, 0 to 255 for −1 to 1; None: unreadable.

        Sources without a scale and a bias are assumed to have this encoding.
        """
        key = ("normals", source)
        if key not in self._packed:
            texture = self.texture(source, material)
            levels = [
                _levels(0.5 * scale, 0.5 * bias + 0.5)
                for scale, bias in zip(source.scale[:3], source.bias[:3], strict=True)
            ]
            plain = np.arange(256)
            is_plain = not any(source.bias) or all(np.array_equal(level, plain) for level in levels)
            if texture is not None and not is_plain:
                pixels = texture.pixels.copy()
                for channel, table in enumerate(levels):
                    pixels[..., channel] = table[pixels[..., channel]]
                texture = replace(texture, pixels=pixels)
            self._packed[key] = None if texture is None else replace(texture, is_linear=True)
        return self._packed[key]

    def packed(
        self,
        planes: dict[int, tuple[TextureSource, str]],
        base: TextureSource | None,
        material: str,
    ) -> Texture | None:
        """Texture with channels of others, after their scale and bias; None: unreadable.

        `planes` has a source and its channel (r, g, b or a) by target channel (0 to 3); the other
        channels are those of `base`, or 255.
        """
        key = (tuple(sorted(planes.items())), base)
        if key in self._packed:
            return self._packed[key]
        read = {}
        for channel, (source, name) in planes.items():
            if (texture := self.texture(source, material)) is not None:
                index = CHANNELS.get(name, 0)
                levels = _levels(source.scale[index], source.bias[index])
                read[channel] = texture, levels[texture.pixels[..., index]]
        packed = first = None if base is None else self.texture(base, material)
        if read:
            like = first or next(iter(read.values()))[0]
            shapes = [like.pixels.shape[:2], *(plane.shape for _, plane in read.values())]
            shape = np.max(shapes, axis=0)
            pixels = np.full((*shape, 4), 255, dtype=np.uint8)
            if first is not None:
                pixels[:] = _resized(first.pixels, shape)
            for channel, (_, plane) in read.items():
                pixels[..., channel] = _resized(plane, shape)
            packed = replace(like, pixels=pixels)
        self._packed[key] = packed
        return packed

    def _image(self, source: TextureSource) -> Image.Image | None:
        """Image, not yet decoded; None: missing or in an unknown format."""
        key = source.resolved or source.path
        if key in self._images:
            return self._images[key]
        self._images[key] = None
        if not source.path:
            self._notices.count("texture without a file is not drawn", "texture")
            return None
        with suppress(OSError):  # reported by the resolver
            data = content_of(source.resolved, self._assets.reader) or self._assets[source.path]
            try:
                self._images[key] = Image.open(io.BytesIO(data))
            except Exception:  # Pillow's readers raise exceptions of any type
                self._assets.faults[source.path] = unreadable_image(data)
        return self._images[key]


def content_of(resolved: str, reader: SourceReader) -> bytes:
    """Content of a file or package member; empty if unreadable."""
    if not resolved:
        return b""
    package = Ar.SplitPackageRelativePathOuter(resolved)[0]
    if not Path(package).is_file():  # reading a device might never end
        return b""
    if package == resolved:
        return reader.read(Path(resolved))
    reader.note(Path(package))
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
    return b"" if asset is None else bytes(asset.GetBuffer())


def _levels(scale: float, bias: float) -> Bytes:
    values = np.rint(np.arange(256) * scale + 255.0 * bias)
    return np.clip(values, 0, 255).astype(np.uint8)


def _resized(pixels: Bytes, shape: NDArray[np.integer]) -> Bytes:
    """Pixels (height, width, 4), resampled by nearest neighbor to another height and width."""
    if pixels.shape[:2] == tuple(shape):
        return pixels
    rows = np.arange(shape[0]) * pixels.shape[0] // shape[0]
    columns = np.arange(shape[1]) * pixels.shape[1] // shape[1]
    return pixels[rows[:, None], columns]


# OmniPBR, the material of Omniverse and Isaac Sim, without its gloss maps.

OMNI_PBR_NAMES = ("OmniPBR", "OmniPBR_Opacity")
_MAPS = (
    "reflectionroughness_texture", "metallic_texture", "ORM_texture", "ao_texture",
    "emissive_color_texture", "opacity_texture", "detail_normalmap_texture",
)  # fmt: skip
Color = tuple[float, float, float]


def read_omni_pbr(
    name: str, inputs: Inputs, files: TextureFiles, notices: Omissions
) -> tuple[Material, TextureSource | None]:
    """Material, and the texture that determines its meshes' texture coordinates.

    Source: OmniPBR.mdl's parameters and their defaults, by NVIDIA.
    """
    for key in _MAPS:
        if _asset_texture(inputs, key) is not None:
            notices.count(f"{key} of OmniPBR is not drawn", "material")
    source = _asset_texture(inputs, "diffuse_texture")
    texture = None if source is None else files.texture(source, name)
    color: Color = (1.0, 1.0, 1.0)
    if texture is None:
        color = inputs.get("diffuse_color_constant").color((0.2, 0.2, 0.2))
    red, green, blue = (
        own * tint
        for own, tint in zip(color, inputs.get("diffuse_tint").color((1.0, 1.0, 1.0)), strict=True)
    )
    normal_source = _asset_texture(inputs, "normalmap_texture")
    normal = None if normal_source is None else files.normals(normal_source, name)
    alpha, mode = 1.0, AlphaMode.OPAQUE
    threshold = inputs.get("opacity_threshold").number(0.0)
    if inputs.get("enable_opacity").value:
        alpha = inputs.get("opacity_constant").number(1.0)
        mode = AlphaMode.MASK if threshold > 0.0 else AlphaMode.BLEND
    emissive: Color = (0.0, 0.0, 0.0)
    if inputs.get("enable_emission").value and inputs.get("emissive_intensity").number(40.0) > 0.0:
        emissive = inputs.get("emissive_color").color((1.0, 0.1, 0.1))
    material = Material(
        name,
        (red, green, blue, alpha),
        texture,
        mode,
        alpha_cutoff=threshold if threshold > 0.0 else 0.5,
        metallic=inputs.get("metallic_constant").number(0.0),
        roughness=inputs.get("reflection_roughness_constant").number(0.5),
        specular=min(2.0 * inputs.get("specular_level").number(0.5), 1.0),
        emissive=emissive,
        normal_scale=inputs.get("bump_factor").number(1.0),
        normal_map=normal,
    )
    return material, source or normal_source


def _asset_texture(inputs: Inputs, key: str) -> TextureSource | None:
    value = inputs.get(key).value
    if not isinstance(value, Sdf.AssetPath) or not value.path:
        return None
    (sx, sy), (dx, dy) = inputs.pair("texture_scale", 1.0), inputs.pair("texture_translate", 0.0)
    transform = IDENTITY
    if (sx, sy, dx, dy) != (1.0, 1.0, 0.0, 0.0):  # converts to v down
        transform = (sx, 0.0, dx), (0.0, sy, 1.0 - sy - dy)
    return TextureSource(
        str(value.path), str(value.resolvedPath), "st", transform, ("repeat", "repeat")
    )
