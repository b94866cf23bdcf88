"""JSON of glTF 2.0 as typed objects, with the properties that omnisim draws.

Source: Khronos Group, "glTF 2.0 Specification", section 5; extensions by their own schemas.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from enum import IntEnum
from typing import Annotated, Literal, TypeVar

from pydantic import AliasPath, BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from omnisim.errors import SceneError

Entry = TypeVar("Entry")
Index = Annotated[int, Field(ge=0)]
Number = Annotated[float, Field(gt=-1e15, lt=1e15)]
Name = Annotated[str, Field(strict=False, coerce_numbers_to_str=True)]
Vec2 = tuple[Number, Number]
Vec3 = tuple[Number, Number, Number]
Vec4 = tuple[Number, Number, Number, Number]
Mat4 = Annotated[tuple[Number, ...], Field(min_length=16, max_length=16)]


def _extension(*path: str) -> AliasPath:
    return AliasPath("extensions", *path)


class _Object(BaseModel):
    model_config = ConfigDict(
        strict=True,
        frozen=True,
        allow_inf_nan=False,
        alias_generator=to_camel,
        defer_build=True,  # until a file is read
    )


class Asset(_Object):
    """Version of the format."""

    version: Annotated[str, Field(pattern=r"^2\.\d")]


class Buffer(_Object):
    """Bytes in a file, in a data URI, or in the GLB file itself."""

    byte_length: Index
    uri: str | None = None


class BufferView(_Object):
    """Part of a buffer."""

    buffer: Index
    byte_length: Index
    byte_offset: Index = 0
    byte_stride: Annotated[int, Field(ge=1)] | None = None


class SparseIndices(_Object):
    """Elements that a sparse accessor replaces."""

    buffer_view: Index
    component_type: Literal[5121, 5123, 5125]
    byte_offset: Index = 0


class SparseValues(_Object):
    """Values that a sparse accessor puts there."""

    buffer_view: Index
    byte_offset: Index = 0


class Sparse(_Object):
    """Deviations from an accessor's base values."""

    count: Index
    indices: SparseIndices
    values: SparseValues


class Accessor(_Object):
    """Typed array in a buffer view; zeros where there is none."""

    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Index
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    buffer_view: Index | None = None
    byte_offset: Index = 0
    normalized: bool = False
    sparse: Sparse | None = None


class Draco(_Object):
    """Extension KHR_draco_mesh_compression; `attributes` are its own unique ids."""

    buffer_view: Index
    attributes: dict[str, int]


class Mode(IntEnum):
    """Topology of a primitive, numbered as in OpenGL."""

    POINTS = 0
    LINES = 1
    LINE_LOOP = 2
    LINE_STRIP = 3
    TRIANGLES = 4
    TRIANGLE_STRIP = 5
    TRIANGLE_FAN = 6


class Primitive(_Object):
    """Geometry of one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Mode = Mode.TRIANGLES
    draco: Draco | None = Field(
        default=None, validation_alias=_extension("KHR_draco_mesh_compression")
    )


class Mesh(_Object):
    """Primitives that nodes instantiate together."""

    primitives: tuple[Primitive, ...]
    name: Name | None = None
    weights: tuple[Number, ...] = ()


class Node(_Object):
    """Transform relative to the parent node, and what is attached to it."""

    name: Name | None = None
    children: tuple[Index, ...] = ()
    matrix: Mat4 | None = None
    translation: Vec3 | None = None
    rotation: Vec4 | None = None
    scale: Vec3 | None = None
    mesh: Index | None = None
    skin: Index | None = None
    weights: tuple[Number, ...] = ()
    light: Index | None = Field(
        default=None, validation_alias=_extension("KHR_lights_punctual", "light")
    )


class Scene(_Object):
    """Root nodes."""

    nodes: tuple[Index, ...] = ()


class Skin(_Object):
    """Joints and their inverse bind matrices."""

    joints: tuple[Index, ...]
    inverse_bind_matrices: Index | None = None


class Image(_Object):
    """PNG, JPEG or WebP data."""

    uri: str | None = None
    buffer_view: Index | None = None


class Sampler(_Object):
    """Wrapping modes, numbered as in OpenGL."""

    wrap_s: int = 10497
    wrap_t: int = 10497


class Texture(_Object):
    """Image and its sampler; `webp` is the image of EXT_texture_webp."""

    source: Index | None = None
    sampler: Index | None = None
    webp: Index | None = Field(
        default=None, validation_alias=_extension("EXT_texture_webp", "source")
    )


class TextureTransform(_Object):
    """Extension KHR_texture_transform."""

    offset: Vec2 = (0.0, 0.0)
    rotation: Number = 0.0
    scale: Vec2 = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureInfo(_Object):
    """Reference to a texture."""

    index: Index
    tex_coord: Index = 0
    transform: TextureTransform | None = Field(
        default=None, validation_alias=_extension("KHR_texture_transform")
    )


class MetallicRoughness(_Object):
    """Base colour."""

    base_color_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | None = None


class SpecularGlossiness(_Object):
    """Extension KHR_materials_pbrSpecularGlossiness: its diffuse colour."""

    diffuse_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | None = None


class Material(_Object):
    """Appearance of a surface."""

    name: Name | None = None
    metallic_roughness: MetallicRoughness = Field(
        default_factory=MetallicRoughness, validation_alias="pbrMetallicRoughness"
    )
    specular_glossiness: SpecularGlossiness | None = Field(
        default=None, validation_alias=_extension("KHR_materials_pbrSpecularGlossiness")
    )
    unlit: object = Field(default=None, validation_alias=_extension("KHR_materials_unlit"))
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: Number = 0.5
    double_sided: bool = False


class Spot(_Object):
    """Cone of a spot light."""

    inner_cone_angle: Number = 0.0
    outer_cone_angle: Number = math.pi / 4.0


class Light(_Object):
    """Light of KHR_lights_punctual."""

    type: str
    color: Vec3 = (1.0, 1.0, 1.0)
    intensity: Number = 1.0
    range: Number | None = None
    spot: Spot = Field(default_factory=Spot)


class Document(_Object):
    """Top-level object of a glTF file."""

    asset: Asset
    scene: Index = 0
    scenes: tuple[Scene, ...] = ()
    nodes: tuple[Node, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    accessors: tuple[Accessor, ...] = ()
    buffer_views: tuple[BufferView, ...] = ()
    buffers: tuple[Buffer, ...] = ()
    materials: tuple[Material, ...] = ()
    textures: tuple[Texture, ...] = ()
    images: tuple[Image, ...] = ()
    samplers: tuple[Sampler, ...] = ()
    skins: tuple[Skin, ...] = ()
    animations: tuple[object, ...] = ()
    extensions_used: tuple[str, ...] = ()
    extensions_required: tuple[str, ...] = ()
    lights: tuple[Light, ...] = Field(
        default=(), validation_alias=_extension("KHR_lights_punctual", "lights")
    )


def parse_document(text: bytes) -> Document:
    """Parse and check the JSON of a glTF file.

    Raises:
        SceneError: the first fault, with its place in the JSON.
    """
    try:
        return Document.model_validate_json(text.removeprefix(b"\xef\xbb\xbf"))
    except ValidationError as faults:
        fault = faults.errors(include_url=False, include_context=False)[0]
    place = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in fault["loc"])
    message = "missing" if fault["type"] == "missing" else fault["msg"]
    expected = re.sub(r"^(Input|Tuple|String) should (be|have|match) ", "expected ", message)
    if expected != message:
        message = f"{expected}, got {str(fault['input'])[:80]!r}"
    raise SceneError(f"not glTF 2.0: {place.lstrip('.')}{': ' if place else ''}{message}")


def lookup(entries: Sequence[Entry], index: int, place: str) -> Entry:
    """Entry of a top-level array that an index refers to.

    Raises:
        SceneError: there is no such entry; `place` is the index's own in the JSON.
    """
    if index < len(entries):
        return entries[index]
    raise SceneError(f"{place}: expected an index below {len(entries)}, got {index}")
