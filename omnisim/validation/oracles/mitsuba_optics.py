"""Optical systems with physical mirrors and windows, traced by Mitsuba 3.

Only the shapes' heights and normals, poses and refractive indices of omnisim's optics are used.
Mirrors are meshes of metal; a window's boundaries are spheres or discs of a smooth dielectric.
Mitsuba itself determines the direction of a pixel.

A boundary reflects part of the light, which is lost here. An image is divided by the image of a
white world with the same random numbers, which leaves averages over the rays that pass.

Coordinates are along the world's axes, from the mean origin of the system's rays, in hundredths of
the largest distance of an origin from this mean: Mitsuba starts a reflected ray
9e-5 (1 + coordinate) off the surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import HyperbolicCamera, PerspectiveCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.optics import OpticalSystem, Rod, Surface
from omnisim.cameras.optics.shapes import Conic, Plane
from omnisim.core.arrays import Floats, Floats32, Ints
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.core.errors import OpticsError
from omnisim.core.poses import check_pose
from omnisim.scene import Scene
from omnisim.validation.oracles import mitsuba_scene as scenes
from omnisim.validation.oracles.surfaces import visible_surfaces

SIZE_UNITS = 100.0
_WINDOW_SIZES = 50.0  # radius of a window without a rim


@dataclass(frozen=True, eq=False)
class PhysicalOptics:
    """Surfaces and pinhole of a system in Mitsuba's units.

    Raises:
        OmnisimError: another camera, or a matrix that is not a pose.
    """

    system: OpticalSystem  # system with a perspective camera
    world_from_optical: Floats  # (4, 4) pose of the sensor's optical frame
    _white: dict[tuple[int, int], Floats32] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        check_pose(self.world_from_optical)
        if not isinstance(self.system.camera, PerspectiveCamera):
            raise OpticsError(f"camera: expected a pinhole, got {self.system.camera.model_name!r}")

    @cached_property
    def _origins_m(self) -> Floats:
        """Origins (n, 3) of a hundredth of the rays, optical frame."""
        pixels = pixel_grid(self.system.width_px, self.system.height_px)[::10, ::10]
        rays = self.system.rays(pixels)
        return rays.origins_m[rays.valid]

    @property
    def middle_m(self) -> Floats:
        """Origin (3,) of Mitsuba's coordinates in the world frame: the mean origin of the rays."""
        along: Floats = self.world_from_optical[:3, :3] @ self._origins_m.mean(axis=0)
        return along + self.world_from_optical[:3, 3]

    @cached_property
    def size_m(self) -> float:
        """Maximum distance of a ray's origin from the middle."""
        away_m = self._origins_m - self._origins_m.mean(axis=0)
        return float(np.linalg.norm(away_m, axis=1).max())

    @property
    def units_per_m(self) -> float:
        """Scale of Mitsuba's coordinates."""
        return SIZE_UNITS / self.size_m

    def units_from(self, system_from_part: Floats) -> Floats:
        """Affine map (4, 4) from meters in a part's frame to Mitsuba's units."""
        optical_from_system = np.eye(4)
        optical_from_system[:3, 3] = np.negative(self.system.origin_m)
        units_from_part = self.world_from_optical @ optical_from_system @ system_from_part
        units_from_part[:3, 3] -= self.middle_m
        units_from_part[:3] *= self.units_per_m
        return units_from_part

    @cached_property
    def objects(self) -> dict[str, Any]:
        """Surfaces and obstacles, for `mitsuba.load_dict`."""
        objects: dict[str, Any] = {}
        for number, surface in enumerate(self.system.surfaces):
            objects[f"optics {number}"] = (
                self._mirror(surface) if surface.is_mirror else self._boundary(number, surface)
            )
        for number, rod in enumerate(self.system.obstacles):
            objects |= self._rod(number, rod)
        return objects

    def camera(self, samples: int) -> dict[str, Any]:
        """Perspective camera, for `mitsuba.load_dict`."""
        camera = self.system.camera
        assert isinstance(camera, PerspectiveCamera)
        units_from_camera = self.units_from(self.system.system_from_camera)
        content = scenes.pinhole(camera, units_from_camera, 1e-3 * SIZE_UNITS, samples)
        return content | {"far_clip": 1e6 * SIZE_UNITS}

    def _mirror(self, surface: Surface) -> mi.Mesh:
        """Mesh of rings with equal width along the radius, from the hole to the rim."""
        if surface.rim_center_m != (0.0, 0.0):
            raise OpticsError(f"{surface.name}: expected a rim about the axis")
        radii_m = np.linspace(surface.hole_radius_m, surface.visible_radius_m, scenes.RINGS + 1)[
            :, None
        ]
        azimuths = np.arange(scenes.SECTORS) * (2.0 * math.pi / scenes.SECTORS)
        x, y = radii_m * np.cos(azimuths), radii_m * np.sin(azimuths)
        vertices_m = np.stack((x, y, surface.shape.sag_m(np.hypot(x, y))), axis=-1).reshape(-1, 3)
        beside_m = vertices_m.copy()  # a tip has no normal
        beside_m[: scenes.SECTORS, :2] += 1e-9 * vertices_m[-scenes.SECTORS :, :2]
        normals = surface.shape.level(beside_m).gradients
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        to_units = self.units_from(surface.system_from_surface)
        return scenes.mesh_of(
            vertices_m @ to_units[:3, :3].T + to_units[:3, 3],
            scenes.triangles_of_rings(scenes.RINGS, scenes.SECTORS, surface.hole_radius_m > 0.0),
            {"mesh_bsdf": mi.load_dict({"type": "twosided", "bsdf": scenes.metal(1.0)})},
            normals=normals @ to_units[:3, :3].T / self.units_per_m,
        )

    def _boundary(self, number: int, surface: Surface) -> dict[str, Any]:
        """Sphere or disc of a window's boundary; the camera is on its inner side."""
        shape, indices = surface.shape, self.system.indices
        glass = {
            "type": "dielectric",
            "int_ior": indices[number],
            "ext_ior": indices[number + 1],
            "specular_reflectance": scenes.rgb((0.0, 0.0, 0.0)),
        }
        to_units = self.units_from(surface.system_from_surface)
        is_whole = math.isinf(surface.rim_radius_m)
        if isinstance(shape, Conic) and shape.conic == 0.0 and shape.radius_m < 0.0 and is_whole:
            place = to_units[:3, 3] + shape.radius_m * to_units[:3, 2]
            radius = -shape.radius_m * self.units_per_m
            return {"type": "sphere", "center": place.tolist(), "radius": radius, "bsdf": glass}
        if isinstance(shape, Plane):
            to_units[:3, :3] *= min(surface.rim_radius_m, _WINDOW_SIZES * self.size_m)
            to_world = mi.ScalarTransform4f(to_units.astype(np.float32))
            return {"type": "disk", "to_world": to_world, "bsdf": glass}
        raise OpticsError(f"{surface.name}: expected a window's plane or whole sphere")

    def _rod(self, number: int, rod: Rod) -> dict[str, Any]:
        to_units = self.units_from(np.eye(4))
        ends = [to_units[:3, :3] @ end + to_units[:3, 3] for end in (rod.begin_m, rod.end_m)]
        radius = rod.radius_m * self.units_per_m
        black = {"type": "twosided", "bsdf": scenes.metal(0.0)}
        objects: dict[str, Any] = {
            f"rod {number}": {
                "type": "cylinder",
                "p0": ends[0].tolist(),
                "p1": ends[1].tolist(),
                "radius": radius,
                "bsdf": black,
            }
        }
        for side, (at, other) in enumerate((ends, ends[::-1])):
            up = np.eye(3)[np.abs(at - other).argmin()]
            turned = mi.ScalarTransform4f().look_at(
                origin=at.tolist(), target=(2.0 * at - other).tolist(), up=up.tolist()
            )
            objects[f"rod {number} end {side}"] = {
                "type": "disk",
                "to_world": turned @ mi.ScalarTransform4f().scale(radius),
                "bsdf": black,
            }
        return objects

    def image(self, scene: Scene, samples: int, seed: int = 0) -> Floats32:
        """Image (height, width, 3), linear RGB, through physical mirrors and windows.

        Args:
            scene: scene with opaque surfaces only, see `opaque_only`.
            samples: rays per pixel, a square number.
            seed: equal seeds give equal images.

        Raises:
            OmnisimError: a surface or material that Mitsuba does not support.
        """
        surfaces = visible_surfaces(scene, self.middle_m, self.size_m)
        with scenes.scalar_variant():
            shown = {
                f"surface {number}": scenes.shining(surface, self.units_per_m)
                for number, surface in enumerate(surfaces)
            }
            image = self._rendered(shown, scene.background, samples, seed)
            if all(surface.is_mirror for surface in self.system.surfaces):
                return image
            if (samples, seed) not in self._white:
                self._white[samples, seed] = self._rendered({}, (1.0, 1.0, 1.0), samples, seed)
        white = self._white[samples, seed]
        return np.divide(image, white, out=np.zeros_like(image), where=white > 0.0)

    def _rendered(
        self, shown: dict[str, Any], background: tuple[float, ...], samples: int, seed: int
    ) -> Floats32:
        depth = len(self.system.surfaces) + 1
        content = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": depth, "rr_depth": depth + 1},
            "sensor": self.camera(samples),
            "sky": {"type": "constant", "radiance": scenes.rgb(background)},
        }
        return scenes.rendered(content | self.objects | shown, samples, seed)

    def rays(self, pixels_px: Floats) -> tuple[Floats, ...]:
        """Origins (n, 3) in m and directions (n, 3), optical frame, of one ray per pixel (n, 2).

        NaN where the ray misses any of the surfaces.
        """
        camera = self.system.camera
        rays = np.full((2, len(pixels_px), 3), np.nan)
        with scenes.scalar_variant():
            sensor = mi.load_dict(self.camera(1))
            scene = mi.load_dict({"type": "scene", **self.objects})
            for row, on_film in enumerate((pixels_px + 0.5) / (camera.width_px, camera.height_px)):
                place = mi.ScalarPoint2f(on_film.tolist())
                ray, _ = sensor.sample_ray(0.0, 0.5, place, mi.ScalarPoint2f(0.5))
                for _ in self.system.surfaces:
                    hit = scene.ray_intersect(ray)
                    if not hit.is_valid():
                        break
                    sampled, _ = hit.bsdf().sample(
                        mi.BSDFContext(), hit, 0.999, mi.ScalarPoint2f(0.5)
                    )
                    ray = hit.spawn_ray(hit.to_world(sampled.wo))
                else:
                    rays[:, row] = np.array(ray.o), np.array(ray.d)
        turn = self.world_from_optical[:3, :3]
        origins_m = rays[0] / self.units_per_m + self.middle_m - self.world_from_optical[:3, 3]
        return origins_m @ turn, rays[1] @ turn


# Physical mirror in front of a pinhole camera, traced by Mitsuba 3.
#
# Only Eq. 1 of omnisim's optics is used: the mirror's surface with its normals, and the pinhole
# in its other focus. Mitsuba itself determines the direction of a pixel, by reflecting its
# camera's rays off a mesh of metal.
#
# A pixel is the average over its square. There is no near plane. Around the rim the camera sees
# the scene directly: compare inside the rim.
#
# Coordinates are along the world's axes from the effective viewpoint, in hundredths of the rim's
# radius. Mitsuba starts a reflected ray 9e-5 (1 + coordinate) off the surface: 1 µm in these
# units. If coordinates were in meters, it would be 0.1 mm, which is 0.012 px on a scene 1 m away.


RIM_UNITS = 100.0


def trace_mirror(
    scene: Scene,
    camera: HyperbolicCamera,
    world_from_optical: ArrayLike,
    samples: int,
    seed: int = 0,
) -> Floats32:
    """Trace the image (height, width, 3), linear RGB, of a camera that looks at a mirror.

    The mirror has flat facets with interpolated normals. For the paper's mirror at 512 × 512 px,
    facets and float32 move rays to a scene 1 m away by less than 0.0008 px on average and 0.002 px
    at most (`tests/validation/oracles`). A few rays in 100 000 pass between two facets.

    Args:
        scene: scene with opaque surfaces only, see `opaque_only`.
        camera: mirror and pinhole camera.
        world_from_optical: (4, 4) pose of the optical frame.
        samples: rays per pixel; a square number, or Mitsuba warns that it rounds up.
        seed: equal seeds give equal images.

    Raises:
        OmnisimError: a matrix that is not a pose.
        SceneError: a material that is not opaque, or that Mitsuba does not support.
    """
    pose = check_pose(world_from_optical)
    mirror = camera.mirror
    reach_m = float(mirror.rho_m(mirror.theta_max_rad))  # the rim is farthest
    surfaces = visible_surfaces(scene, pose[:3, 3], reach_m)
    units_per_m = RIM_UNITS / mirror.rim_radius_m
    with scenes.scalar_variant():
        content = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},  # one reflection
            "sensor": mirror_pinhole(camera, pose[:3, :3], units_per_m, samples),
            "mirror": mirror_of_metal(mirror, pose[:3, :3], units_per_m),
            "sky": {"type": "constant", "radiance": scenes.rgb(scene.background)},
        }
        for number, surface in enumerate(surfaces):
            content[f"surface {number}"] = scenes.shining(surface, units_per_m)
        return scenes.rendered(content, samples, seed)


def mirror_pinhole(
    camera: HyperbolicCamera, world_from_optical: Floats, units_per_m: float, samples: int
) -> dict[str, Any]:
    """Mitsuba's perspective camera in the mirror's other focus, for `mitsuba.load_dict`.

    Args:
        world_from_optical: (3, 3) rotation.
    """
    c = camera.mirror.c_m * units_per_m
    to_world = np.column_stack((world_from_optical, -c * world_from_optical[:, 2]))
    # of the scene seen past the mirror
    return scenes.pinhole(camera, to_world, 0.1 * c, samples) | {"far_clip": 1e3 * c}


def mirror_of_metal(
    mirror: HyperbolicMirror, world_from_optical: Floats, units_per_m: float
) -> mi.Mesh:
    """Mesh of the mirror that reflects all light.

    Args:
        world_from_optical: (3, 3) rotation.
    """
    vertices_m, triangles = mirror_mesh(mirror)
    world_from_mirror = world_from_optical @ MIRROR_FROM_OPTICAL.T
    return scenes.mesh_of(
        vertices_m @ world_from_mirror.T * units_per_m,
        triangles,
        {"mesh_bsdf": mi.load_dict(scenes.metal(1.0))},
        normals=mirror.normals(vertices_m) @ world_from_mirror.T,
    )


def mirror_mesh(
    mirror: HyperbolicMirror, rings: int = scenes.RINGS, sectors: int = scenes.SECTORS
) -> tuple[Floats, Ints]:
    """Vertices (n, 3) on Eq. 1 up to the rim, mirror frame, meters, and triangles (m, 3).

    Rings have equal width seen along the axis.
    """
    radius_m = np.linspace(0.0, mirror.rim_radius_m, rings + 1)[:, None]
    azimuth = np.arange(sectors) * (2.0 * math.pi / sectors)
    x, y = radius_m * np.cos(azimuth), radius_m * np.sin(azimuth)
    z = np.broadcast_to(mirror.height_from_radius_m(radius_m), x.shape)
    return np.stack((x, y, z), axis=-1).reshape(-1, 3), scenes.triangles_of_rings(rings, sectors)
