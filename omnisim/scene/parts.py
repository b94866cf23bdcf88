"""Plain-data parts of a scene: meshes, materials, instances, lights, starts, paths.

A string below a field is the help of a key in scene files; other fields have comments.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Bytes, Floats, Floats32, bounds_of
from omnisim.core.files.parameters import (
    NOT_IN_FILES,
    AboveZero,
    Fraction,
    Level,
    Name,
    NotNegative,
    Number,
    Parameters,
    Point,
    Positive,
    Signed,
)
from omnisim.core.short_repr import counted, point_text, short_repr
from omnisim.scene.light.baked_light import BakedLight
from omnisim.scene.light.environment import Environment
from omnisim.scene.motion.deformation import Deformation

LightRectangle = tuple[float, float, float, float]


class Wrap(Enum):
    """Texture wrapping mode beyond the edges."""

    REPEAT = "repeat"
    CLAMP_TO_EDGE = "clamp_to_edge"


class AlphaMode(Enum):
    """Alpha mode, as in glTF."""

    OPAQUE = "opaque"
    MASK = "mask"
    BLEND = "blend"


Shares = tuple[Fraction, Fraction, Fraction]
MAX_EMISSION = 65504.0  # largest half float, the precision of images
Emission = Annotated[Number, Field(ge=0.0, le=MAX_EMISSION)]
LinearRgb = tuple[NotNegative, NotNegative, NotNegative]
Byte = Annotated[int, Field(ge=0, le=255, strict=True)]
MAX_CLASS = 60_000  # channels have 16 bits; the rest is reserved for unlabeled instances
IDENTITY_UV = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class Texture:
    """Texture with sRGB-encoded colors or linear values."""

    pixels: Bytes  # (height, width, 4) uint8 RGBA, first row at texture coordinate v = 0
    wrap_u: Wrap = Wrap.REPEAT
    wrap_v: Wrap = Wrap.REPEAT
    is_linear: bool = False  # True for linear values, false for sRGB-encoded colors
    # 0: the mesh's first texture coordinates; 1: its second. Always 0 for a base color
    uv_set: int = 0
    # (2, 3) affine transform of those coordinates; identity for a base color
    uv_transform: tuple[tuple[float, float, float], tuple[float, float, float]] = IDENTITY_UV

    def __repr__(self) -> str:
        height, width = self.pixels.shape[:2]
        return short_repr(self, f"{width} × {height} px")


# For glass and for soft edges: a ray hits where the surface hides at least half of the background.
BLENDED_CUTOFF = 0.5
_DARKEST = 1e-30  # share of light that fully absorbing glass leaves after its distance


@dataclass(frozen=True, eq=False)
class Material:
    """Material of a surface: base color, alpha, sides, and the reflectance model of glTF 2.0.

    The default is matte: Lambertian, without gloss. Dielectric gloss requires `specular`, which is
    1 for a dielectric in glTF.

    Source: glTF 2.0, section 3.9 and appendix B; KHR_materials_specular, _ior, _clearcoat,
        _transmission, _volume, _dispersion.
    """

    name: str = ""  # material name in the file
    # linear RGBA, multiplied with the texture and the vertex colors
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: Texture | None = None  # base color texture; None: no texture
    alpha_mode: AlphaMode = AlphaMode.OPAQUE  # opaque, mask or blend
    alpha_cutoff: float = 0.5  # smallest alpha of the surface in MASK mode; below it is a hole
    double_sided: bool = False  # render both sides
    unlit: bool = False  # render without lighting
    metallic: Fraction = 0.0
    """1: metal; 0: dielectric; a factor of blue of `metallic_roughness_map`."""
    roughness: Fraction = 1.0
    """0: mirror; 1: diffuse; a factor of green of `metallic_roughness_map`. Glass rougher than 0.2
    is frosted."""
    specular: Fraction = 0.0
    """Strength of a dielectric's gloss; 1 is physical. The built-in matte materials have 0."""
    specular_color: Shares = (1.0, 1.0, 1.0)
    """Linear RGB tint of a dielectric's gloss."""
    ior: Annotated[Number, Field(ge=1.0, le=4.0)] = 1.5
    """Refractive index of a dielectric."""
    clearcoat: Fraction = 0.0
    """Strength of the clear coat; a factor of red of `clearcoat_map`."""
    clearcoat_roughness: Fraction = 0.0
    """Roughness of the clear coat; a factor of green of `clearcoat_map`."""
    emissive: tuple[Emission, Emission, Emission] = (0.0, 0.0, 0.0)
    """Emitted light, linear RGB, a factor of `emissive_map`; 1 is white."""
    # normal_scale, occlusion_strength, clearcoat_normal_scale: strengths of the maps
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    clearcoat_normal_scale: float = 1.0
    # metallic_roughness_map, normal_map, occlusion_map: linear textures
    metallic_roughness_map: Texture | None = None
    normal_map: Texture | None = None
    occlusion_map: Texture | None = None
    emissive_map: Texture | None = None  # color texture
    casts_shadow: bool = True  # cast shadows of the scene's lights
    # color texture whose color multiplies `specular_color` and whose alpha multiplies `specular`
    specular_map: Texture | None = None
    # clearcoat_map, clearcoat_normal_map: linear textures
    clearcoat_map: Texture | None = None
    clearcoat_normal_map: Texture | None = None
    transmission: Fraction = 0.0
    """Share of a dielectric's non-reflected light that passes through it. A blended material with
    transmission becomes glass instead."""
    thickness_m: NotNegative = 0.0
    """0: transmission is that of a thin pane; above: that of a closed body of glass."""
    attenuation_color: Shares = (1.0, 1.0, 1.0)
    """Linear RGB of white light after attenuation_distance_m in a body of glass."""
    attenuation_distance_m: Positive = math.inf
    """Distance in a body of glass, m; infinite: clear glass."""
    dispersion: NotNegative = 0.0
    """20 over the Abbe number of a body of glass; 0: none."""

    @property
    def maps(self) -> tuple[Texture | None, ...]:
        """Textures other than the base color texture."""
        return (
            self.metallic_roughness_map, self.normal_map, self.occlusion_map, self.emissive_map,
            self.specular_map, self.clearcoat_map, self.clearcoat_normal_map,
        )  # fmt: skip

    @property
    def absorption_per_m(self) -> tuple[float, float, float]:
        """Absorption coefficients of Beer and Lambert's law in glass, linear RGB."""
        red, green, blue = (
            -math.log(max(share, _DARKEST)) / self.attenuation_distance_m
            for share in self.attenuation_color
        )
        return red, green, blue

    @property
    def optical_depths(self) -> tuple[float, float, float]:
        """Optical depths, linear RGB, of a slab that is met perpendicularly; 0: no slab."""
        return 0.0, 0.0, 0.0

    def __repr__(self) -> str:
        texture = "" if self.texture is None else repr(self.texture)
        return short_repr(self, repr(self.name), self.alpha_mode.value, texture)

    @property
    def hit_cutoff(self) -> float:
        """Smallest alpha that counts as a ray hit (colors are blended instead); 0: everywhere."""
        if self.alpha_mode is AlphaMode.MASK:
            return self.alpha_cutoff
        return BLENDED_CUTOFF if self.alpha_mode is AlphaMode.BLEND else 0.0

    @property
    def shadow_cutoff(self) -> float:
        """Smallest alpha at which the surface casts a shadow; `math.inf`: nowhere."""
        return self.hit_cutoff if self.casts_shadow else math.inf


@dataclass(frozen=True, eq=False, repr=False)
class SlabMaterial(Material):
    """Material of a slab of glass: a pane with two faces, which only traced images refract."""

    slab_m: float = 0.0  # distance between its faces

    @property
    def optical_depths(self) -> tuple[float, float, float]:
        """Optical depths between its faces, linear RGB."""
        red, green, blue = self.absorption_per_m
        return red * self.slab_m, green * self.slab_m, blue * self.slab_m


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one material, centered on their own origin for float32 precision."""

    name: str  # mesh name in the file
    positions: Floats32  # (n, 3) float32, file units
    triangles: NDArray[np.uint32]  # (m, 3) uint32, counter-clockwise seen from the front
    material: int  # index into `Scene.materials`
    normals: Floats32 | None = None  # (n, 3) float32; None: flat shading
    # (n, 2) float32, (0, 0) at the texture's top left; None: untextured
    texture_coordinates: Floats32 | None = None
    colors: Floats32 | None = None  # (n, 4) float32 linear RGBA; None: no vertex colors
    second_texture_coordinates: Floats32 | None = None  # (n, 2) float32; None: only one set
    # deformation over time, with positions and normals at 0 s; None: rigid
    deformation: Deformation | None = None
    # (n, 2) float32 lightmap coordinates in [0, 1], relative to `Instance.light_rectangle`; None:
    # no lightmap
    light_coordinates: Floats32 | None = None

    def coordinates_of(self, texture: Texture) -> Floats32 | None:
        """Texture coordinates (n, 2) for a texture's `uv_set`, before its `uv_transform`."""
        return self.second_texture_coordinates if texture.uv_set else self.texture_coordinates

    def __repr__(self) -> str:
        vertices = counted(len(self.positions), "vertex", "vertices")
        return short_repr(self, repr(self.name), vertices, counted(len(self.triangles), "triangle"))


@dataclass(frozen=True, eq=False)
class Instance:
    """Occurrence of a mesh in the world."""

    name: str  # node name in the file, shared by all parts of one object
    mesh: int  # index into `Scene.meshes`
    world_from_mesh: Floats  # (4, 4) float64 transform, m
    # (4, 4) float64 transform of the node, m; its axes are parallel to the world's unless the node
    # is rotated. Default: identity
    world_from_node: Floats = field(default_factory=lambda: np.eye(4))
    # lightmap region (left, top, width, height) in [0, 1]; None: lit by the probes
    light_rectangle: LightRectangle | None = None
    # lightmap region of the back faces; None: same light as the front
    light_back_rectangle: LightRectangle | None = None

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), f"mesh {self.mesh}")


@dataclass(frozen=True, eq=False)
class Link:
    """Rigid part of a file's robots or models."""

    name: str
    world_from_link: Floats  # (4, 4) pose at rest; its axes are those of the file's link
    # link that it is rigidly fixed to; itself: it moves; empty: fixed to the world
    fixed_to: str
    instances: frozenset[str] = frozenset()  # by name, besides those named after it: `name/…`

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name))


class LightKind(Enum):
    """Light types of KHR_lights_punctual."""

    DIRECTIONAL = "directional"
    POINT = "point"
    SPOT = "spot"


@dataclass(frozen=True, eq=False)
class Light:
    """Directional, point or spot light.

    Attributes:
        position_m: (3,) world frame; unused for a directional light.
        direction: (3,) unit vector, world frame, along which the light travels; unused for a point
            light.
        cone_cosines: cosines of a spot light's inner and outer half-angles.
        casts_shadow: True: surfaces block the light, except those within `LAMP_NEAR_M`.

    Source: glTF extension KHR_lights_punctual.
    """

    kind: LightKind
    """Type of lamp, as in glTF; directional lamps are infinitely far away."""
    color: LinearRgb
    """Linear RGB, multiplied with the intensity or illuminance."""
    intensity: Positive
    """Illuminance of a directional lamp, lx, or luminous intensity of others, cd."""
    position_m: Floats = field(default_factory=lambda: np.zeros(3))
    direction: Floats = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))
    range_m: Positive = math.inf
    """Distance at which the light of a point or spot lamp ends, m. Default: infinite."""
    cone_cosines: tuple[float, float] = field(default=(1.0, 0.0), metadata=NOT_IN_FILES)
    casts_shadow: bool = field(default=True, metadata=NOT_IN_FILES)

    def __repr__(self) -> str:
        return short_repr(self, self.kind.value, f"intensity {self.intensity:g}")


# A lamp sits inside its bulb, which must not block the light.
LAMP_NEAR_M = 0.05
MAX_LIGHTS = 32  # maximum per surface: each light costs time at every texel


@dataclass(frozen=True)
class Fog:
    """Homogeneous fog or water: attenuates light along a ray and adds its own color.

    Over a distance of d meters, the fraction exp(−attenuation · d) of each channel remains.
    """

    color: LinearRgb
    """Linear RGB at infinite distance."""
    attenuation_per_m: tuple[NotNegative, NotNegative, NotNegative]
    """Attenuation of R, G and B per meter, instead of visibility_m: water absorbs red first."""


@dataclass(frozen=True, eq=False)
class Lighting:
    """Lights of a scene and their exposure.

    A white surface under ambient light (1, 1, 1) alone has the color (1, 1, 1). Each light adds its
    illuminance times `exposure`, weighted by Lambert's cosine.
    """

    ambient: tuple[float, float, float]  # linear RGB, equal from all directions
    lights: tuple[Light, ...]  # at most `MAX_LIGHTS` lights
    exposure: float = 1.0  # brightness of a white surface per lux
    # distant light, added to the ambient light; None: no environment
    environment: Environment | None = None
    fog: Fog | None = None  # fog between the cameras and the surfaces; None: no fog
    is_matte: bool = False  # render all materials as matte, including those of dynamic objects
    # baked light, which replaces the ambient light and the diffuse light of all lamps; None:
    # computed at run time
    baked: BakedLight | None = None

    def background(self, color: tuple[float, float, float]) -> tuple[float, float, float]:
        """Linear RGB of rays without a hit: the fog's color if there is fog, otherwise `color`."""
        return color if self.fog is None else self.fog.color

    @property
    def has_shadows(self) -> bool:
        """True if any light casts shadows."""
        return any(light.casts_shadow for light in self.lights)

    def by_kind(self) -> tuple[tuple[Light, ...], tuple[Light, ...]]:
        """Directional lights, and point and spot lights, as two groups."""
        directional = [light for light in self.lights if light.kind is LightKind.DIRECTIONAL]
        punctual = [light for light in self.lights if light.kind is not LightKind.DIRECTIONAL]
        return tuple(directional), tuple(punctual)

    def with_shadows(self, casts: bool) -> Lighting:
        """Copy in which all lights cast shadows, or none does."""
        lights = tuple(replace(light, casts_shadow=casts) for light in self.lights)
        return replace(self, lights=lights)

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.lights), "light"), f"exposure {self.exposure:g}")


@dataclass(frozen=True)
class StartPose:
    """Default camera pose: position of the effective viewpoint, world frame, and heading."""

    position_m: Point
    """Position in the world, m, z up."""
    yaw_deg: Number = 0.0
    """Heading, degrees counter-clockwise from the world's x."""


@dataclass(frozen=True)
class CameraPose:
    """Camera from a scene file: viewpoint in the world frame and attitude, x forward."""

    name: str
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    # lens of the file; None: not stated, or of a model that omnisim does not have
    lens: CentralCamera | None = None


@dataclass(frozen=True)
class NamedStart(Parameters, name="start"):
    """Start pose of a vehicle's base."""

    name: Name
    """Name of the start pose, unique."""
    position_m: Point
    """Position in the world, m, z up."""
    yaw_deg: Number = 0.0
    """Heading, degrees counter-clockwise from the world's x."""


@dataclass(frozen=True)
class ColorBand(Parameters, name="band"):
    """Color of a landmark between two heights above its base."""

    color: Name
    """Name of the color, shared by all bands of that color."""
    linear_rgb: LinearRgb
    """Linear RGB, before lighting."""
    bottom_m: Level
    """Bottom of the band, m above the landmark's base."""
    top_m: AboveZero
    """Top of the band, m above the landmark's base."""


# Widest footprint of a slim landmark. Seen from 1 m, it spans 11°.
SLIM_M = 0.2


@dataclass(frozen=True)
class Landmark(Parameters, name="landmark"):
    """Object recognized by its colors, at a known position."""

    name: Name
    """Name of the landmark, unique, and prefix of its nodes' names."""
    position_m: Point
    """Center of its base in the world, m."""
    footprint_m: tuple[AboveZero, AboveZero]
    """Extents along the world's x and y, m."""
    bands: tuple[ColorBand, ...]
    """Color bands from bottom to top, without gaps."""

    def __repr__(self) -> str:
        colors = "/".join(band.color for band in self.bands)
        return short_repr(self, repr(self.name), colors, f"at {point_text(self.position_m)} m")

    @property
    def height_m(self) -> float:
        """Height from its base to the top of its last band."""
        return self.bands[-1].top_m

    @property
    def is_slim(self) -> bool:
        """True for a pillar, whose position is its axis; false for a wall or a goal."""
        return max(self.footprint_m) <= SLIM_M


@dataclass(frozen=True)
class ScenePath(Parameters, name="path"):
    """Route of a vehicle: corners on the ground, in driving order."""

    name: Name
    """Name of the path, unique."""
    waypoints_m: Annotated[tuple[tuple[Signed, Signed], ...], Field(min_length=2)]
    """Corners [x, y] on the ground, world frame, m, in driving order."""
    start_yaw_deg: Number | None = None
    """Heading at the first corner, degrees. Default: toward the second corner."""

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), counted(len(self.waypoints_m), "waypoint"))


@dataclass(frozen=True)
class LabelRule:
    """Class of instances; `omnisim/scene/labels.py` explains the keys."""

    id: Annotated[int, Field(ge=1, le=MAX_CLASS, strict=True)]
    """ID of the class in the channel, unique. Default: the next free one."""
    name: Name
    """Name of the class, unique."""
    color: tuple[Byte, Byte, Byte]
    """8-bit sRGB for images. Default: chosen automatically."""
    nodes: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Patterns of node names with the wildcards `*` and `?`; the first match decides."""

    def __repr__(self) -> str:
        return short_repr(self, str(self.id), repr(self.name), " ".join(self.nodes))


def bounds_m(meshes: tuple[Mesh, ...], instances: tuple[Instance, ...]) -> Floats:
    """Smallest and largest corner (2, 3) of the instances' joint bounding box, world frame, m."""
    if not instances:
        return np.array([[np.inf] * 3, [-np.inf] * 3])
    boxes = instance_bounds_m(meshes, instances)
    return np.stack((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))


def instance_bounds_m(meshes: tuple[Mesh, ...], instances: tuple[Instance, ...]) -> Floats:
    """Smallest and largest corner (n, 2, 3) of each instance's bounding box, world frame, m."""
    numbers = [instance.mesh for instance in instances]
    box_of = {number: bounds_of(meshes[number].positions) for number in set(numbers)}
    boxes = np.array([box_of[number] for number in numbers], np.float64)
    corners = boxes[:, np.indices((2, 2, 2)).reshape(3, 8).T, [0, 1, 2]]  # (instances, 8, 3)
    world_from_mesh = np.array([instance.world_from_mesh for instance in instances])
    world = corners @ world_from_mesh[:, :3, :3].swapaxes(1, 2) + world_from_mesh[:, None, :3, 3]
    return np.stack((world.min(axis=1), world.max(axis=1)), axis=1)
