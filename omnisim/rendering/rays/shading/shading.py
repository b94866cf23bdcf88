"""Appearance of surfaces at ray hits: base color, normal, light.

The twin of shaders/scene/surface.frag. Textures are filtered over the footprint of a sample: the
region of the surface between a ray and its neighbors.
Source of the footprints: Igehy, "Tracing ray differentials", 1999.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Indices, Ints32
from omnisim.core.world import Poses
from omnisim.rendering.rays.caster import RayHits, WorldRays
from omnisim.rendering.rays.geometry import Geometry
from omnisim.rendering.rays.shading.lit_surfaces import (
    CastShadow,
    LampLight,
    Reflectance,
    Shadows,
    SurfaceDirections,
    Traced,
    ambient_light,
    coat_fresnel,
    lamps_at,
    reflected_light,
    with_lamps,
)
from omnisim.rendering.rays.shading.ray_optics import (
    NO_MEDIUM,
    Arrivals,
    Glass,
    LightPaths,
    Lobe,
    Panes,
    Refracted,
    TracedGloss,
    Tracing,
    halfway_spreads,
    interface_reflectance,
    pane_reflectance,
    refracted_rays,
    traced_gloss,
)
from omnisim.rendering.rays.shading.surface_table import (
    NORMAL,
    NORMAL_SCALES,
    ReflectanceTable,
    Sampler,
    TextureTable,
    mapped_normals,
)
from omnisim.scene.light.baked_light import BakedLight
from omnisim.scene.model import Lighting
from omnisim.scene.surface_kind import SurfaceKind, kind_of, mask_of, transmitted
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS

# Mip level bias, as in `sensor_tiles`: averaging within the pixel removes slight oversharpness.
LEVEL_BIAS = -0.5
_DARKEST = 1e-20


class RayView(NamedTuple):
    """Rays (n,), their hits, and their footprints (n, 2, 3), which filter textures; None: none."""

    rays: WorldRays
    hits: RayHits
    world_from_objects: Poses = ()
    footprints: Floats32 | None = None

    @classmethod
    def of(cls, hits: RayHits) -> RayView:
        """View of static places, from nowhere."""
        nowhere = np.zeros((len(hits.triangles), 3))
        return cls(WorldRays(nowhere, nowhere, hits.ranges_m, hits.ranges_m), hits)

    def take(self, indices: Indices) -> RayView:
        """View of the rays at indices (m,)."""
        footprints = None if self.footprints is None else self.footprints[indices]
        return RayView(
            self.rays.take(indices), self.hits.take(indices), self.world_from_objects, footprints
        )


class Shading:
    """Appearance of a scene's surfaces; tables are built once.

    Attributes:
        is_blended, is_unlit, is_pane, is_glass, is_specular, is_double_sided: (surfaces,) masks.
        is_slab: (surfaces,) mask of glass that beams and depths pass like panes.
        is_mirror: (surfaces,) mask of surfaces that are smooth somewhere, see `SurfaceKind`.
        panes: parameters of the surfaces that are panes.
        glass: parameters of the surfaces that are thick glass.
        frosted: (surfaces,) transmitted share of the light that frosted panes do not reflect.
        table: reflectance of the surfaces.
        hit_cutoff, shadow_cutoff: (surfaces,) alpha cutoffs, see `omnisim.scene.model.Material`.
    """

    def __init__(self, geometry: Geometry, lighting: Lighting):
        self._geometry, self._lighting = geometry, lighting
        materials = [surface.material for surface in geometry.surfaces]
        self._textures = TextureTable(geometry.surfaces)
        kinds = [kind_of(material, lighting.is_matte) for material in materials]
        self.table = ReflectanceTable(geometry.surfaces, mask_of(kinds, SurfaceKind.MATTE))
        self._base_color = np.array(
            [material.base_color for material in materials], dtype=np.float32
        ).reshape(-1, 4)
        self._is_lightmapped = np.array(
            [surface.is_lightmapped for surface in geometry.surfaces], np.bool_
        )
        self.is_unlit = mask_of(kinds, SurfaceKind.UNLIT)
        self.is_blended = mask_of(kinds, SurfaceKind.BLENDED)
        self.panes = Panes.of(materials)
        self.glass = Glass.of(materials, lighting.is_matte)
        self.is_glass = mask_of(kinds, SurfaceKind.REFRACTING)
        self.is_slab = mask_of(kinds, SurfaceKind.SLAB)
        self.is_pane = mask_of(kinds, SurfaceKind.PANE) & ~self.is_slab
        frosted = [transmitted(material, SurfaceKind.FROSTED_PANE) for material in materials]
        self.frosted = np.array(frosted) * (not lighting.is_matte)
        self.is_specular = mask_of(kinds, SurfaceKind.SPECULAR)
        self.is_mirror = mask_of(kinds, SurfaceKind.MIRROR)
        self.is_double_sided = geometry.is_double_sided
        self.hit_cutoff = np.array([m.hit_cutoff for m in materials], dtype=np.float32)
        self.shadow_cutoff = np.array([m.shadow_cutoff for m in materials], dtype=np.float32)

    def surfaces(self, hits: RayHits) -> Ints32:
        """Surfaces (n,) of the hits."""
        return self._geometry.surface_of_triangle[hits.triangles]

    def base_colors(self, view: RayView) -> Floats32:
        """Linear RGBA (n, 4) base colors, before lighting."""
        surfaces = self.surfaces(view.hits)
        colors = self._base_color[surfaces]
        if self._geometry.colors is not None:
            colors *= self._interpolated(self._geometry.colors, view.hits)
        textures = self._textures.texture_of_surface[surfaces]
        textured = np.flatnonzero(textures >= 0)
        if len(textured):
            colors[textured] *= self._sampled(self._textures, textures[textured], view, textured)
        return colors

    def transmitted(self, view: RayView, colors: Floats32) -> Floats32:
        """Transmittance (n, 3) of panes with base colors (n, 3 or more); 0 at other surfaces."""
        surfaces = self.surfaces(view.hits)
        shares = np.zeros((len(surfaces), 3), dtype=np.float32)
        indices = np.flatnonzero(self.is_pane[surfaces])
        if len(indices):
            normals = self.normals(view.hits.take(indices), view.world_from_objects)
            cosines = np.abs(np.einsum("nc,nc->n", normals, view.rays.directions[indices]))
            shares[indices] = self.panes.transmitted(
                surfaces[indices], colors[indices, :3], cosines
            )
        return shares

    def media(self, hits: RayHits, media: Ints32, world_from_objects: Poses) -> Ints32:
        """Media (n,) before hits of rays that started in media (n,): glass, if its back is hit."""
        surfaces = self.surfaces(hits)
        glass = np.flatnonzero(self.is_glass[surfaces])
        leaving = glass[~self.is_front(hits.take(glass), world_from_objects)]
        media = media.copy()
        media[leaving] = surfaces[leaving]
        return media

    def refracted(self, view: RayView, colors: Floats32, channel: int | None) -> Refracted:
        """Rays that pass surfaces of thick glass, all hit, with base colors (n, 3 or more)."""
        surfaces = self.surfaces(view.hits)
        is_front = self.is_front(view.hits, view.world_from_objects)
        normals = self.normals(view.hits, view.world_from_objects)
        normals = self._mapped(NORMAL, normals, view, self.sampler(view))
        ratios = self.glass.ratios(surfaces, is_front, channel)
        cosines = np.abs(np.einsum("nc,nc->n", normals, view.rays.directions))
        passing = 1.0 - interface_reflectance(cosines, ratios)
        shares = (passing * self.glass.transmission[surfaces])[:, None] * colors[:, :3]
        return Refracted(
            refracted_rays(view.rays, view.hits, normals, ratios),
            shares.astype(np.float32),
            np.where(is_front, surfaces, np.int32(NO_MEDIUM)),
        )

    def emitted(self, hits: RayHits) -> Floats32:
        """Light (n, 3), linear RGB, that surfaces emit; all rays must hit."""
        light = self.materials(RayView.of(hits))[:, 2:]
        unlit = np.flatnonzero(self.is_unlit[self.surfaces(hits)])
        light[unlit] = self.base_colors(RayView.of(hits.take(unlit)))[:, :3]
        return light

    def _sampled(
        self, table: TextureTable, textures: Indices, view: RayView, indices: Indices
    ) -> Floats32:
        """Texels (m, 4) of textures (m,) at the hits with indices (m,)."""
        hits, geometry = view.hits.take(indices), self._geometry
        corners = self._corner_coordinates(table, textures, hits)
        coordinates = np.einsum("nk,nkc->nc", hits.weights, corners)
        levels = np.zeros(len(indices), dtype=np.float32)
        if view.footprints is not None:
            levels = _mip_levels(
                geometry.corners_m(hits.triangles, view.world_from_objects),
                corners * table.sizes_px(textures)[:, None],
                view.rays.directions[indices],
                hits.ranges_m[:, None, None] * view.footprints[indices],
            )
        return table.lookup(textures, coordinates, levels)

    def _corner_coordinates(
        self, table: TextureTable, textures: Indices, hits: RayHits
    ) -> Floats32:
        """Texture coordinates (n, 3, 2) of the hit triangles' corners."""
        geometry = self._geometry
        vertices = geometry.corners[hits.triangles]
        second = geometry.second_coordinates
        return table.place(
            textures,
            geometry.texture_coordinates[vertices],
            None if second is None else second[vertices],
        )

    def normals(self, hits: RayHits, world_from_objects: Poses = ()) -> Floats32:
        """Unit normals (n, 3) of the visible side, world: interpolated, or of the triangle."""
        of_corners = self._geometry.corner_normals(hits.triangles, world_from_objects)
        normals: Floats32 = np.einsum("nk,nkc->nc", hits.weights, of_corners)
        for moved, pose in self._geometry.moved(hits.triangles, world_from_objects):
            normals[moved] = np.einsum("nj,ij->ni", normals[moved], pose[:3, :3])
        is_flat = ~normals.any(axis=1)
        normals[is_flat] = hits.planes[is_flat]
        is_behind = np.einsum("nc,nc->n", normals, hits.planes) < 0.0
        normals[is_behind] *= np.float32(-1.0)
        lengths = np.sqrt(np.einsum("nc,nc->n", normals, normals))
        normals /= np.maximum(lengths, np.float32(_DARKEST))[:, None]
        return normals

    def materials(self, view: RayView) -> Floats32:
        """Roughness, metalness and emission (n, 5), see `Hits.materials`."""
        surfaces = self.surfaces(view.hits)
        materials = np.zeros((len(surfaces), 5), dtype=np.float32)
        materials[:, 0] = 1.0
        glossy = np.flatnonzero(~self.table.is_matte[surfaces])
        if len(glossy):
            values = self.table.values(surfaces[glossy], self.sampler(view.take(glossy)))
            materials[glossy, 0], materials[glossy, 1] = values.roughness, values.metallic
            materials[glossy, 2:] = values.emissive
        return materials

    def lit(
        self,
        colors: Floats32,
        view: RayView,
        cast_shadow: CastShadow,
        tracing: Tracing | None = None,
    ) -> Floats32:
        """Light (n, 3), linear RGB, from surfaces of base colors (n, 3 or more) toward the rays.

        With `tracing`, smooth surfaces reflect the scene; without it, only sky and lamps.
        """
        rays, hits, world_from_objects, _ = view
        surfaces = self.surfaces(hits)
        points_m = rays.origins_m + hits.ranges_m[:, None] * rays.directions
        normals = self.normals(hits, world_from_objects)
        glossy = np.flatnonzero(~self.table.is_matte[surfaces])
        baked = self._lighting.baked
        if baked is None:
            lamps = lamps_at(self._lighting, points_m, normals, Shadows(hits, cast_shadow))
            light = with_lamps(ambient_light(self._lighting, normals), lamps, normals)
            lamps = [lamp.take(glossy) for lamp in lamps]
        else:
            light = self._baked_light(baked, hits, points_m, normals)
            shadows = Shadows(hits.take(glossy), cast_shadow)
            lamps = lamps_at(self._lighting, points_m[glossy], normals[glossy], shadows)
        lamps = [lamp.facing(normals[glossy]) for lamp in lamps]
        surroundings = None
        if baked is not None:  # without the light of lamps
            of_lamps = with_lamps(np.zeros_like(light[glossy]), lamps, normals[glossy])
            beyond: Floats32 = light[glossy] - of_lamps
            surroundings = np.maximum(beyond, np.float32(0.0), out=beyond)
        light[self.is_unlit[surfaces]] = 1.0
        light *= colors[:, :3]
        if len(glossy):
            light[glossy] = self._reflected(
                colors[glossy, :3], view.take(glossy), lamps, normals[glossy], surroundings,
                None if tracing is None else tracing.take(glossy),
            )  # fmt: skip
        return light

    def _baked_light(
        self, baked: BakedLight, hits: RayHits, points_m: Floats, normals: Floats32
    ) -> Floats32:
        """Baked light (n, 3) on white surfaces at points (n, 3) with unit normals (n, 3)."""
        light = np.empty((len(points_m), 3), dtype=np.float32)
        is_lightmapped = self._is_lightmapped[self.surfaces(hits)]
        static, others = np.flatnonzero(is_lightmapped), np.flatnonzero(~is_lightmapped)
        light_coordinates = self._geometry.light_coordinates
        if light_coordinates is not None and len(static):
            seen = hits.take(static)
            front, back = np.split(self._interpolated(light_coordinates, seen), 2, axis=1)
            light[static] = baked.light(np.where(self.is_front(seen)[:, None], front, back))
        if len(others):
            light[others] = baked.probes.light(points_m[others], normals[others])
        return light

    def is_front(self, hits: RayHits, world_from_objects: Poses = ()) -> Bools:
        """Mask (n,) of hits on the front of triangles; without poses, of static ones."""
        a, b, c = np.moveaxis(self._geometry.corners_m(hits.triangles, world_from_objects), 1, 0)
        return np.einsum("nc,nc->n", np.cross(b - a, c - a), hits.planes) > 0.0

    def _reflected(
        self,
        colors: Floats32,
        view: RayView,
        lamps: Sequence[LampLight],
        normals: Floats32,
        surroundings: Floats32 | None,
        tracing: Tracing | None,
    ) -> Floats32:
        """Light (n, 3), linear RGB, from surfaces of which some are not matte."""
        surfaces, sampled = self.surfaces(view.hits), self.sampler(view)
        mapped, coat = (self._mapped(slot, normals, view, sampled) for slot in NORMAL_SCALES)
        directions = SurfaceDirections(mapped, coat, normals, -view.rays.directions)
        reflectance = self.table.reflectance(surfaces, colors, sampled)
        traced = scattered = spreads = None
        if tracing is not None:
            reflectance = self._of_glass(reflectance, view, directions, tracing.paths.channel)
            arrivals = self._arrivals(view, tracing.paths)
            traced = _traced(reflectance, directions, arrivals, tracing)
            spreads = None if tracing.paths.cones is None else arrivals.spreads
            if self.frosted.any():
                scattered = self._scattered(reflectance, colors, arrivals, directions, tracing)
                body = reflectance.body * (1.0 - self.frosted[surfaces, None])
                reflectance = reflectance._replace(body=body)
        light = reflected_light(
            reflectance, directions, self._lighting, lamps, surroundings, traced, spreads
        )
        if scattered is not None:
            light[scattered.indices] += scattered.light
        return light.astype(np.float32)

    def _arrivals(self, view: RayView, paths: LightPaths) -> Arrivals:
        """Arrivals of paths (n,)."""
        curvatures_per_m = np.zeros(len(view.rays.near_m))
        split = np.flatnonzero(paths.is_split)
        if len(split):
            triangles = view.hits.triangles[split]
            corners = self._geometry.corners_m(triangles, view.world_from_objects)
            normals = self._geometry.corner_normals(triangles, view.world_from_objects)
            edges, bends = (
                np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2)
                for points in (corners, normals)
            )
            curvatures_per_m[split] = (bends / np.maximum(edges, 1e-9)).max(axis=1)
        spreads = halfway_spreads(paths, view.hits.ranges_m, curvatures_per_m)
        return Arrivals(view.rays, view.hits, view.footprints, spreads)

    def _scattered(
        self,
        surface: Reflectance,
        colors: Floats32,
        arrivals: Arrivals,
        directions: SurfaceDirections,
        tracing: Tracing,
    ) -> TracedGloss | None:
        """Light that frosted panes among surfaces (n,) transmit; None: none."""
        surfaces = self.surfaces(arrivals.hits)
        shares = self.frosted[surfaces]
        indices = np.flatnonzero(shares > 0.0)
        if len(indices) == 0:
            return None
        ior = self.panes.ior[surfaces[indices]]
        passing = shares[indices] * (1.0 - pane_reflectance(np.ones(len(indices)), ior))
        lobe = Lobe(
            directions.normals[indices],
            surface.roughness[indices],
            passing[:, None] * colors[indices],
            np.zeros(len(indices)),  # by Schlick's term, none at grazing incidence
            (1.0 - coat_fresnel(surface.coat, directions))[indices],
        )
        found = traced_gloss(lobe, arrivals.take(indices), tracing.take(indices), transmits=True)
        if found is None:
            return None
        light = lobe.strength[found.indices, None] * found.light
        return TracedGloss(indices[found.indices], light)

    def _of_glass(
        self,
        surface: Reflectance,
        view: RayView,
        directions: SurfaceDirections,
        channel: int | None,
    ) -> Reflectance:
        """Reflectance in which panes and thick glass are mirrors with Fresnel's reflectance."""
        surfaces = self.surfaces(view.hits)
        panes, glass = (np.flatnonzero(mask[surfaces]) for mask in (self.is_pane, self.is_glass))
        indices = np.concatenate((panes, glass))
        if len(indices) == 0:
            return surface
        cosines = np.abs(np.einsum("nc,nc->n", directions.normals, directions.views))
        is_front = self.is_front(view.hits.take(glass), view.world_from_objects)
        ratios = self.glass.ratios(surfaces[glass], is_front, channel)
        reflected = np.concatenate((
            pane_reflectance(cosines[panes], self.panes.ior[surfaces[panes]]),
            interface_reflectance(cosines[glass], ratios),
        ))  # fmt: skip
        body, f0, f90 = surface.body.copy(), surface.f0.copy(), surface.f90.copy()
        roughness = surface.roughness.copy()
        f0[indices], f90[indices], roughness[indices] = reflected[:, None], reflected, MIN_ROUGHNESS
        transmission = np.maximum(self.panes.transmission, self.glass.transmission)
        body[indices] *= 1.0 - transmission[surfaces[indices], None]
        return surface._replace(body=body, f0=f0, f90=f90, roughness=roughness)

    def sampler(self, view: RayView) -> Sampler:
        """Function that looks up textures at hits by their indices."""
        surfaces = self.surfaces(view.hits)

        def sampled(slot: int, indices: Indices) -> Floats32:
            table = self.table.maps[slot]
            return self._sampled(table, table.texture_of_surface[surfaces[indices]], view, indices)

        return sampled

    def _mapped(self, slot: int, normals: Floats32, view: RayView, sampled: Sampler) -> Floats32:
        """Normals (n, 3) after applying the normal maps in a slot."""
        surfaces = self.surfaces(view.hits)
        indices, textures = self.table.textured(slot, surfaces)
        if len(indices) == 0:
            return normals
        hits = view.hits.take(indices)
        corners_m = self._geometry.corners_m(hits.triangles, view.world_from_objects)
        coordinates = self._corner_coordinates(self.table.maps[slot], textures, hits)
        normals = normals.copy()
        normals[indices] = mapped_normals(
            normals[indices], corners_m, coordinates, hits.planes,
            sampled(slot, indices), self.table.normal_scales[slot][surfaces[indices]],
        )  # fmt: skip
        return normals

    def _interpolated(self, of_vertices: Floats32, hits: RayHits) -> Floats32:
        """Values (n, k) at the hits, interpolated from vertex values (vertices, k)."""
        return np.einsum(
            "nk,nkc->nc", hits.weights, of_vertices[self._geometry.corners[hits.triangles]]
        )


def _traced(
    surface: Reflectance, directions: SurfaceDirections, arrivals: Arrivals, tracing: Tracing
) -> Traced:
    """Trace the reflections of surfaces (n,) and of their clear coats."""
    strengths = np.ones(len(surface.coat))
    gloss = Lobe(directions.normals, surface.roughness, surface.f0, surface.f90, strengths)
    traced = traced_gloss(gloss, arrivals, tracing)
    indices = np.flatnonzero(surface.coat > 0.0)
    if len(indices) == 0:
        return Traced(traced, None)
    white = np.ones((len(indices), 3))
    coats = Lobe(
        directions.coat_normals[indices],
        surface.coat_roughness[indices],
        white,
        strengths[indices],
        coat_fresnel(surface.coat, directions)[indices],
    )
    coat = traced_gloss(coats, arrivals.take(indices), tracing.take(indices))
    return Traced(traced, None if coat is None else coat._replace(indices=indices[coat.indices]))


def _mip_levels(
    corners_m: Floats, corners_px: Floats32, directions: Floats, steps_m: Floats
) -> Floats32:
    """Mip levels (n,) at which a texel is as wide as a footprint.

    Args:
        corners_m: (n, 3, 3) triangle corners, world.
        corners_px: (n, 3, 2) texture coordinates of the corners, in texels of the finest level.
        directions: (n, 3) ray directions.
        steps_m: (n, 2, 3) from the hit to points at the same range on the neighboring samples'
            rays.
    """
    edges_m, edges_px = corners_m[:, 1:] - corners_m[:, :1], corners_px[:, 1:] - corners_px[:, :1]
    planes = np.cross(edges_m[:, 0], edges_m[:, 1])
    along = np.einsum("nc,nc->n", planes, directions)
    along = np.where(np.abs(along) > _DARKEST, along, _DARKEST)
    # project onto the plane along the ray
    slides = np.einsum("nsc,nc->ns", steps_m, planes) / along[:, None]
    steps_m = steps_m - slides[..., None] * directions[:, None]
    # weights of the second and third corner, solved in the plane
    squared = np.maximum(np.einsum("nc,nc->n", planes, planes), _DARKEST)
    second = np.einsum("nsc,nc->ns", steps_m, np.cross(edges_m[:, 1], planes))
    third = np.einsum("nsc,nc->ns", steps_m, np.cross(planes, edges_m[:, 0]))
    weights = np.stack((second, third), axis=-1) / squared[:, None, None]
    steps_px = np.einsum("nse,nec->nsc", weights, edges_px)
    longest = np.einsum("nsc,nsc->ns", steps_px, steps_px).max(axis=1)
    levels: Floats32 = (0.5 * np.log2(longest + _DARKEST)).astype(np.float32)
    return levels + np.float32(LEVEL_BIAS)
