"""Shader inputs as values, textures or primvars, resolved through connections."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdShade

from omnisim.scene.formats.omissions import Omissions

Affine = tuple[tuple[float, float, float], tuple[float, float, float]]
Rgba = tuple[float, float, float, float]
IDENTITY: Affine = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
_FLIP_V = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
_MAX_CHAIN = 20  # limit on nodes for texture coordinates, in case of a loop


class TextureSource(NamedTuple):
    """Texture of a shader.

    Attributes:
        path: path in the stage.
        resolved: path of the file or package member; empty: not found.
        primvar: primvar with the texture coordinates.
        uv_transform: (2, 3) affine transform of the coordinates, with v down.
        wraps: wrapping modes along s and t, named as in UsdUVTexture.
        scale, bias: RGBA; the value is the texture's times scale, plus bias.
        fallback: RGBA in place of an unreadable file.
    """

    path: str
    resolved: str
    primvar: str = "st"
    uv_transform: Affine = IDENTITY
    wraps: tuple[str, str] = ("useMetadata", "useMetadata")
    scale: Rgba = (1.0, 1.0, 1.0, 1.0)
    bias: Rgba = (0.0, 0.0, 0.0, 0.0)
    fallback: Rgba = (0.0, 0.0, 0.0, 1.0)


class ShaderInput(NamedTuple):
    """Shader input: a value, a texture or a primvar.

    Attributes:
        value: usd-core value; None: no value.
        texture: connected texture; None: no texture.
        channel: channels of the texture: r, g, b, a or rgb.
        primvar: name of a connected primvar; empty: no primvar.
    """

    value: object = None
    texture: TextureSource | None = None
    channel: str = "r"
    primvar: str = ""

    def number(self, default: float) -> float:
        """Value as a finite number, or the default."""
        value = self.value
        is_number = isinstance(value, int | float) and math.isfinite(value)
        return float(value) if isinstance(value, int | float) and is_number else default

    def color(self, default: tuple[float, float, float]) -> tuple[float, float, float]:
        """Value as a linear color, or the default."""
        red, green, blue = numbers(self.value, default)
        return red, green, blue

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
        first, second = numbers(self.get(name).value, (default, default))
        return first, second

    def _texture(self, node: UsdShade.Shader) -> TextureSource:
        file = self._value(node, "file")
        path, resolved = "", ""
        if isinstance(file, Sdf.AssetPath):
            path, resolved = str(file.path), str(file.resolvedPath)
        primvar, transform = self._coordinates(node)
        wraps = self._text(node, "wrapS"), self._text(node, "wrapT")
        # a mirrored texture is stored next to its mirror image
        u, v = (
            tuple(x * (0.5 if wrap == "mirror" else 1.0) for x in row)
            for row, wrap in zip(transform, wraps, strict=True)
        )
        return TextureSource(
            path,
            resolved,
            primvar,
            ((u[0], u[1], u[2]), (v[0], v[1], v[2])),
            wraps,
            self._rgba(node, "scale", (1.0, 1.0, 1.0, 1.0)),
            self._rgba(node, "bias", (0.0, 0.0, 0.0, 0.0)),
            self._rgba(node, "fallback", (0.0, 0.0, 0.0, 1.0)),
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

    def _transform(self, node: UsdShade.Shader) -> NDArray[np.float64]:
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
        value: object = attribute.Get(self._time)
        return value

    def _text(self, node: UsdShade.Shader, name: str) -> str:
        value = self._value(node, name)
        return value if isinstance(value, str) else ""

    def _rgba(self, node: UsdShade.Shader, name: str, default: Rgba) -> Rgba:
        red, green, blue, alpha = numbers(self._value(node, name), default)
        return red, green, blue, alpha


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


def numbers(value: object, default: tuple[float, ...]) -> tuple[float, ...]:
    """Value as finite numbers, as many as in the default, or else the default."""
    if value is None or isinstance(value, str | int | float):
        return default
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.shape != (len(default),):
        return default
    return tuple(array.astype(np.float64).tolist()) if np.isfinite(array).all() else default
