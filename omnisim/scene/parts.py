"""Parts of a scene, as plain data: meshes, materials, instances, lights, starts, paths."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from omnisim.core.bounds import bounds_of
from omnisim.core.short_repr import counted, short_repr
from omnisim.scene.light.baked_light import BakedLight
from omnisim.scene.light.environment import Environment
from omnisim.scene.motion.deformation import Deformation

LightRectangle = tuple[float, float, float, float]


class Wrap(Enum):
    """Wrapping mode of a texture beyond its edges."""

    REPEAT = "repeat"
    CLAMP_TO_EDGE = "clamp_to_edge"


class AlphaMode(Enum):
    """Alpha mode, as in glTF."""

    OPAQUE = "opaque"
    MASK = "mask"
    BLEND = "blend"


IDENTITY_UV = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class Texture:
    """Image with sRGB-encoded colors, or with linear values.

    Attributes:
        pixels: (height, width, 4) uint8 RGBA, first row at texture coordinate v = 0.
        wrap_u, wrap_v: wrapping modes.
        is_linear: values, not colors.
        uv_set: 0: the mesh's texture coordinates; 1: its second ones. A base color has 0.
        uv_transform: (2, 3) affine, of those coordinates; a base color has the identity.
    """

    pixels: NDArray[np.uint8]
    wrap_u: Wrap = Wrap.REPEAT
    wrap_v: Wrap = Wrap.REPEAT
    is_linear: bool = False
    uv_set: int = 0
    uv_transform: tuple[tuple[float, float, float], tuple[float, float, float]] = IDENTITY_UV

    def __repr__(self) -> str:
        height, width = self.pixels.shape[:2]
        return short_repr(self, f"{width} × {height} px")


# Glass, or an image with soft edges: it counts where it hides at least half of what is behind it.
BLENDED_CUTOFF = 0.5


@dataclass(frozen=True, eq=False)
class Material:
    """Appearance of a surface: base color, alpha, sides, and glTF 2.0's reflectance.

    By default it is matte: by Lambert's law, without any gloss. A dielectric's gloss needs
    `specular`, which is 1 for one of glTF's.

    Attributes:
        name: name in the file.
        base_color: linear RGBA that multiplies texture and vertex colors.
        texture: base color texture, if any.
        alpha_mode: opaque, mask or blend.
        alpha_cutoff: with MASK, alpha below this is a hole.
        double_sided: both sides are drawn.
        unlit: drawn without lights, always.
        casts_shadow: lamps cast its shadow.
        metallic, roughness: 0 to 1, which multiply blue and green of `metallic_roughness_map`.
        specular, specular_color: strength and tint, linear RGB, of a dielectric's gloss.
        ior: refractive index of a dielectric.
        clearcoat, clearcoat_roughness: strength and roughness of a clear layer on top, which
            multiply red and green of `clearcoat_map`.
        emissive: light that it emits, linear RGB from 0; it multiplies `emissive_map`.
        normal_scale, occlusion_strength, clearcoat_normal_scale: of their maps.
        metallic_roughness_map, normal_map, occlusion_map: linear textures.
        emissive_map: texture of colors.
        specular_map: texture of colors that multiply `specular_color`, whose alpha multiplies
            `specular`.
        clearcoat_map, clearcoat_normal_map: linear textures.

    Source: glTF 2.0, section 3.9 and appendix B; KHR_materials_specular, _ior, _clearcoat.
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: Texture | None = None
    alpha_mode: AlphaMode = AlphaMode.OPAQUE
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    unlit: bool = False
    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 0.0
    specular_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ior: float = 1.5
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    clearcoat_normal_scale: float = 1.0
    metallic_roughness_map: Texture | None = None
    normal_map: Texture | None = None
    occlusion_map: Texture | None = None
    emissive_map: Texture | None = None
    casts_shadow: bool = True
    specular_map: Texture | None = None
    clearcoat_map: Texture | None = None
    clearcoat_normal_map: Texture | None = None

    @property
    def maps(self) -> tuple[Texture | None, ...]:
        """Textures beside that of the base color."""
        return (
            self.metallic_roughness_map, self.normal_map, self.occlusion_map, self.emissive_map,
            self.specular_map, self.clearcoat_map, self.clearcoat_normal_map,
        )  # fmt: skip

    @property
    def is_matte(self) -> bool:
        """Base color and lights are all that counts: no gloss, no metal, no maps, no emission."""
        strengths = (self.metallic, self.specular, self.clearcoat, *self.emissive)
        return self.unlit or not (any(strengths) or any(one is not None for one in self.maps))

    @property
    def is_blended(self) -> bool:
        """Transparency: surfaces behind it shine through."""
        return self.alpha_mode is AlphaMode.BLEND

    def __repr__(self) -> str:
        texture = "" if self.texture is None else repr(self.texture)
        return short_repr(self, repr(self.name), self.alpha_mode.value, texture)

    @property
    def hit_cutoff(self) -> float:
        """Alpha from which on a ray hits the surface, but for colors; 0: everywhere."""
        if self.alpha_mode is AlphaMode.MASK:
            return self.alpha_cutoff
        return BLENDED_CUTOFF if self.alpha_mode is AlphaMode.BLEND else 0.0

    @property
    def shadow_cutoff(self) -> float:
        """Alpha from which on the surface casts a shadow; infinite: nowhere."""
        return self.hit_cutoff if self.casts_shadow else math.inf


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one material, about their own origin so that float32 holds them.

    Attributes:
        name: name in the file.
        positions: (n, 3) float32, in the units of the file.
        triangles: (m, 3) uint32, counter-clockwise seen from the front.
        material: index into `Scene.materials`.
        normals: (n, 3) float32, or None: flat triangles.
        texture_coordinates: (n, 2) float32, (0, 0) at the texture's top left, or None.
        colors: (n, 4) float32 linear RGBA, or None.
        second_texture_coordinates: (n, 2) float32, or None.
        deformation: by time, or None: it is rigid; else positions and normals are those at 0 s.
        light_coordinates: (n, 2) float32 from 0 to 1, see `Instance.light_rectangle`; or None.
    """

    name: str
    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    material: int
    normals: NDArray[np.float32] | None = None
    texture_coordinates: NDArray[np.float32] | None = None
    colors: NDArray[np.float32] | None = None
    second_texture_coordinates: NDArray[np.float32] | None = None
    deformation: Deformation | None = None
    light_coordinates: NDArray[np.float32] | None = None

    def coordinates_of(self, texture: Texture) -> NDArray[np.float32] | None:
        """Texture coordinates (n, 2) that place a texture, before its transform."""
        return self.second_texture_coordinates if texture.uv_set else self.texture_coordinates

    def __repr__(self) -> str:
        vertices = counted(len(self.positions), "vertex", "vertices")
        return short_repr(self, repr(self.name), vertices, counted(len(self.triangles), "triangle"))


@dataclass(frozen=True, eq=False)
class Instance:
    """Occurrence of a mesh in the world.

    Attributes:
        name: name of the node in the file; parts of one object share it.
        mesh: index into `Scene.meshes`.
        world_from_mesh: (4, 4) float64, meters.
        world_from_node: (4, 4) float64, meters, of the node, whose axes are the world's where it is
            not turned; by default the world's own frame.
        light_rectangle: left, top, width and height in the scene's baked light, from 0 to 1, which
            the mesh's light coordinates are of; None: it takes the probes'.
        light_back_rectangle: of the back sides; None: they have the light of the front.
    """

    name: str
    mesh: int
    world_from_mesh: NDArray[np.float64]
    world_from_node: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    light_rectangle: LightRectangle | None = None
    light_back_rectangle: LightRectangle | None = None

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), f"mesh {self.mesh}")


class LightKind(Enum):
    """The lights of KHR_lights_punctual."""

    DIRECTIONAL = "directional"
    POINT = "point"
    SPOT = "spot"


@dataclass(frozen=True, eq=False)
class Light:
    """Directional, point or spot light.

    Attributes:
        kind: directional, point or spot.
        color: linear RGB.
        intensity: directional in lux, point and spot in candela.
        position_m: (3,) world; unused when directional.
        direction: (3,) unit, world, the way the light travels; unused for a point light.
        range_m: where a point or spot light ends.
        cone_cosines: cosines of a spot light's inner and outer half-angle.
        casts_shadow: surfaces hide it, but for those nearer to it than `LAMP_NEAR_M`.

    Source: glTF extension KHR_lights_punctual.
    """

    kind: LightKind
    color: tuple[float, float, float]
    intensity: float
    position_m: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    direction: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))
    range_m: float = math.inf
    cone_cosines: tuple[float, float] = (1.0, 0.0)
    casts_shadow: bool = True

    def __repr__(self) -> str:
        return short_repr(self, self.kind.value, f"intensity {self.intensity:g}")


# A lamp stands inside of its bulb, which hides nothing.
LAMP_NEAR_M = 0.05
MAX_LIGHTS = 32  # that a surface is shaded by: each costs time at every texel


@dataclass(frozen=True)
class Fog:
    """Homogeneous fog, or water: light is lost along a ray, and the fog's own comes in.

    At a distance of d meters a share exp(−attenuation · d) is left of each channel.

    Attributes:
        color: linear RGB at an infinite distance.
        attenuation_per_m: of R, G and B.
    """

    color: tuple[float, float, float]
    attenuation_per_m: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Lighting:
    """Lights of a scene, and their exposure.

    A white surface under ambient (1, 1, 1) alone has color (1, 1, 1). A light adds its
    illuminance times `exposure`, by Lambert's cosine.

    Attributes:
        ambient: linear RGB, the same from everywhere.
        lights: at most `MAX_LIGHTS`.
        exposure: brightness of a white surface for one lux.
        environment: light from far away, beside the ambient; None: there is no more.
        fog: between cameras and what they see; None: the air is clear.
        is_matte: all materials, also of dynamic objects, are drawn as matte ones.
        baked: light on surfaces, in place of the ambient light and all lamps' diffuse light; None:
            it is computed.
    """

    ambient: tuple[float, float, float]
    lights: tuple[Light, ...]
    exposure: float = 1.0
    environment: Environment | None = None
    fog: Fog | None = None
    is_matte: bool = False
    baked: BakedLight | None = None

    def background(self, color: tuple[float, float, float]) -> tuple[float, float, float]:
        """Linear RGB where nothing is hit: the background's, or the fog's before it."""
        return color if self.fog is None else self.fog.color

    @property
    def has_shadows(self) -> bool:
        """Some light casts shadows."""
        return any(light.casts_shadow for light in self.lights)

    def by_kind(self) -> tuple[tuple[Light, ...], tuple[Light, ...]]:
        """Directional lights, and point and spot lights."""
        is_directional = [light.kind is LightKind.DIRECTIONAL for light in self.lights]
        return (
            tuple(itertools.compress(self.lights, is_directional)),
            tuple(itertools.compress(self.lights, (not one for one in is_directional))),
        )

    def with_shadows(self, casts: bool) -> Lighting:
        """Lighting by the same lights, all of which cast shadows, or none."""
        return replace(
            self, lights=tuple(replace(light, casts_shadow=casts) for light in self.lights)
        )

    def without_shadows(self) -> Lighting:
        """Lighting by the same lights, none of which casts shadows."""
        return self.with_shadows(False)

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.lights), "light"), f"exposure {self.exposure:g}")


@dataclass(frozen=True)
class StartPose:
    """Default pose of the camera: its effective viewpoint, world, and heading."""

    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0


@dataclass(frozen=True)
class CameraPose:
    """Pose of a camera in a scene's file: its viewpoint, world, and its attitude, x ahead."""

    name: str
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0


@dataclass(frozen=True)
class NamedStart:
    """Start pose of a vehicle: its base in the world, z up."""

    name: str
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0


@dataclass(frozen=True)
class ColorBand:
    """Color of a landmark between two heights above its base.

    Attributes:
        color: name of the color, the same for all that have it.
        linear_rgb: the color itself, before any light.
        bottom_m, top_m: above the landmark's base.
    """

    color: str
    linear_rgb: tuple[float, float, float]
    bottom_m: float
    top_m: float


# A landmark of a footprint up to this wide is slim. The widest, seen from 1 m, spans 11°.
SLIM_M = 0.2


@dataclass(frozen=True)
class Landmark:
    """Object recognized by its colors, at a known position.

    Attributes:
        name: its name; names of its nodes begin with it.
        position_m: the middle of its base, world.
        footprint_m: extent along the world's x and y.
        bands: from bottom to top, without gaps.
    """

    name: str
    position_m: tuple[float, float, float]
    footprint_m: tuple[float, float]
    bands: tuple[ColorBand, ...]

    def __repr__(self) -> str:
        colors = "/".join(band.color for band in self.bands)
        return short_repr(self, repr(self.name), colors, f"at {_point(self.position_m)} m")

    @property
    def height_m(self) -> float:
        """Height from its base to the top of its last band."""
        return self.bands[-1].top_m

    @property
    def is_slim(self) -> bool:
        """True for a pillar, whose position is that of its axis; false for a wall or goal."""
        return max(self.footprint_m) <= SLIM_M


@dataclass(frozen=True)
class ScenePath:
    """Route for a vehicle.

    Attributes:
        name: distinct within a scene.
        waypoints_m: (x, y) of its corners on the ground, world, one after the other.
        start_yaw_deg: heading at the first of them, or None: towards the second.
    """

    name: str
    waypoints_m: tuple[tuple[float, float], ...]
    start_yaw_deg: float | None = None

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), counted(len(self.waypoints_m), "waypoint"))


@dataclass(frozen=True)
class LabelRule:
    """Class of instances, by patterns of their names.

    Attributes:
        id: from 1; distinct.
        name: distinct.
        color: 8-bit sRGB, for images.
        nodes: patterns of instances' names, `*` and `?` stand for any letters.
    """

    id: int
    name: str
    color: tuple[int, int, int]
    nodes: tuple[str, ...]

    def __repr__(self) -> str:
        return short_repr(self, str(self.id), repr(self.name), " ".join(self.nodes))


def _point(position_m: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in position_m) + ")"


def bounds_m(meshes: tuple[Mesh, ...], instances: tuple[Instance, ...]) -> NDArray[np.float64]:
    """Smallest and largest corner (2, 3) of the instances' bounding boxes in the world."""
    if not instances:
        return np.array([[np.inf] * 3, [-np.inf] * 3])
    boxes = instance_bounds_m(meshes, instances)
    return np.stack((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))


def instance_bounds_m(
    meshes: tuple[Mesh, ...], instances: tuple[Instance, ...]
) -> NDArray[np.float64]:
    """Smallest and largest corner (n, 2, 3) of each instance's bounding box in the world."""
    boxes = np.array([bounds_of(mesh.positions) for mesh in meshes], np.float64)[
        [instance.mesh for instance in instances]
    ]
    corners = boxes[:, np.indices((2, 2, 2)).reshape(3, 8).T, [0, 1, 2]]  # (instances, 8, 3)
    world_from_mesh = np.array([instance.world_from_mesh for instance in instances])
    world = corners @ world_from_mesh[:, :3, :3].swapaxes(1, 2) + world_from_mesh[:, None, :3, 3]
    return np.stack((world.min(axis=1), world.max(axis=1)), axis=1)
