"""Line drawings of a camera: section of a mirror or optical system, or the mapping of a lens."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, HyperbolicCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.optics import OpticalSystem, Surface, caustic_points
from omnisim.cameras.optics.surface import Fate

RAYS = 15
_POINTS = 81  # points per curve
Floats = NDArray[np.float64]
Json = dict[str, Any]


def profile(model: CentralCamera) -> Json:
    """Lines of a camera as JSON-serializable values.

    `kind` is "section" or "mapping". A section has `curves`, `rays`, `caustic` and `pinhole`, of
    points (x, z) in millimeters, z along the camera's axis. A mapping has `points` with an angle in
    degrees and a radius in pixels.
    """
    if isinstance(model, HyperbolicCamera):
        return _mirror(model.mirror)
    if isinstance(model, OpticalSystem):
        return _system(model)
    return _mapping(model)


def _mirror(mirror: HyperbolicMirror) -> Json:
    """Section through the mirror above its pinhole."""
    theta = np.linspace(-mirror.theta_max_rad, mirror.theta_max_rad, _POINTS)
    curve = _incident(mirror, theta)
    directions = np.linspace(-0.98 * mirror.theta_max_rad, 0.98 * mirror.theta_max_rad, RAYS)
    hits = _incident(mirror, directions)
    pinhole = np.array((0.0, -mirror.c_m))
    reach_m = 2.2 * max(mirror.rim_radius_m, 0.3 * mirror.c_m)
    outward = np.stack((np.sin(directions), -np.cos(directions)), axis=-1)
    rays = [
        _line(np.stack((pinhole, hit, hit + reach_m * out)))
        for hit, out in zip(hits, outward, strict=True)
    ]
    return {
        "kind": "section",
        "curves": [{"kind": "mirror", "points": _line(curve)}],
        "rays": rays,
        "caustic": [[0.0, 0.0]],
        "pinhole": _line(pinhole[None])[0],
    }


def _incident(mirror: HyperbolicMirror, theta_rad: Floats) -> Floats:
    """Points (x, z) (n, 2) of the mirror, m, z up, at angles of incidence from straight down."""
    rho = mirror.rho_m(np.abs(theta_rad))
    # behind the surface: the viewpoint is inside the mirror, and rays arrive from outside
    return np.stack((rho * np.sin(theta_rad), -rho * np.cos(theta_rad)), axis=-1)


def _system(system: OpticalSystem) -> Json:
    u = np.linspace(0.0, system.width_px - 1.0, RAYS)
    row = np.column_stack((u, np.full(RAYS, system.principal_point_px[1])))
    paths = system.paths(row)
    seen = paths.fates == Fate.SEEN
    hits = paths.points_m[:, seen].reshape(-1, 3)
    curves = [
        {"kind": "mirror" if one.is_mirror else "boundary", "points": _line(_curve(one, hits))}
        for one in system.surfaces
    ]
    drawn = hits[:, [0, 2]]
    size_m = float(np.ptp(drawn, axis=0).max()) if len(drawn) else 0.1
    ends = paths.points_m[-1] + 0.8 * size_m * paths.directions
    rays = [
        _line(np.concatenate((paths.points_m[:, ray], ends[ray : ray + 1]))[:, [0, 2]])
        for ray in np.flatnonzero(seen)
    ]
    dense = np.column_stack(
        (np.linspace(0.0, system.width_px - 1.0, 120), np.full(120, system.principal_point_px[1]))
    )
    caustic = (caustic_points(system, dense) + system.origin_m).reshape(-1, 3)[:, [0, 2]]
    caustic = caustic[np.all(np.abs(caustic) < 20.0 * size_m, axis=1)]
    return {
        "kind": "section",
        "curves": curves,
        "rays": rays,
        "caustic": _line(caustic),
        "pinhole": _line(system.system_from_camera[None, [0, 2], 3])[0],
    }


def _curve(surface: Surface, hits_m: Floats) -> Floats:
    """Section (n, 2) of a surface with its own plane y = 0, as (x, z) in m, system frame.

    `hits_m` (n, 3) are points of rays; they set the width of a surface without an edge.
    """
    reach_m = surface.visible_radius_m
    if math.isinf(reach_m):
        local = surface.points_from_system(hits_m)
        reach_m = 1.2 * float(np.hypot(local[:, 0], local[:, 1]).max(initial=1e-3))
    x = np.linspace(-reach_m, reach_m, _POINTS)
    z = surface.shape.sag_m(np.abs(x))
    points = surface.directions_to_system(np.column_stack((x, np.zeros_like(x), z)))
    return (points + surface.system_from_surface[:3, 3])[:, [0, 2]]


def _mapping(model: CentralCamera) -> Json:
    """Mapping of a lens: radius from the principal point, px, over the angle from the axis."""
    theta = np.linspace(0.0, math.pi, 181)
    directions = np.stack((np.sin(theta), np.zeros_like(theta), np.cos(theta)), axis=-1)
    pixels = model.pixel_from_ray(directions)
    middle = getattr(model, "principal_point_px", (0.5 * model.width_px, 0.5 * model.height_px))
    radii = np.hypot(*(pixels.positions_px - middle).T)
    points = np.column_stack((np.degrees(theta), radii))[pixels.valid & np.isfinite(radii)]
    return {"kind": "mapping", "points": np.round(points, 2).tolist()}


def _line(points_m: Floats) -> list[list[float]]:
    """Convert points (n, 2) to millimeters, as a list without non-finite points."""
    finite = points_m[np.all(np.isfinite(points_m), axis=1)]
    return np.round(1e3 * finite, 3).tolist()
