"""Optical systems of all kinds, for tests that hold for each."""

import dataclasses
import math
from pathlib import Path

import omnisim
from omnisim.cameras import EquidistantCamera, PerspectiveCamera
from omnisim.cameras.models.field_of_view import optical_axis
from omnisim.cameras.optics import OpticalSystem, Rod, Surface, read_optics_file
from omnisim.cameras.optics.shapes import Asphere, Cone, Conic, Hyperbolic, Plane, Polynomial
from omnisim.core import poses


def pinhole(focal_length_px):
    return PerspectiveCamera(360, 360, focal_length_px, (179.5, 179.5))


def at(z, x=0.0, **angles_deg):
    return poses.pose((x, 0.0, z), **angles_deg)


def port(distance_m=0.05, thickness_m=0.01, **angles_deg):
    return (
        Surface(Plane(), at(distance_m, **angles_deg), medium="acrylic", name="inside"),
        Surface(Plane(), at(distance_m + thickness_m, **angles_deg), medium="water", name="port"),
    )


def dome(center_m=0.0, x=0.0, rim_m=math.inf):
    return (
        Surface(Conic(-0.05), at(center_m + 0.05, x), rim_m, medium="acrylic", name="inside"),
        Surface(Conic(-0.055), at(center_m + 0.055, x), rim_m, medium="water", name="dome"),
    )


def behind_a_dome(camera, radius_m):
    """Half a dome about the effective viewpoint, on the side to which the camera looks."""
    turn = poses.pose() if optical_axis(camera) > 0.0 else poses.pose(roll_deg=180.0)
    surfaces = [
        Surface(Conic(-outer_m), turn @ poses.pose((0.0, 0.0, outer_m)), medium=medium)
        for outer_m, medium in ((0.9 * radius_m, "glass"), (radius_m, "water"))
    ]
    return OpticalSystem(camera, tuple(surfaces))


def folded():
    """Two mirrors: the camera looks through a hole of the lower one."""
    upper = Surface(Conic(0.15), at(0.12), 0.02, name="upper")
    lower = Surface(Conic(-0.15, -1.0), at(0.02), 0.07, hole_radius_m=0.012, name="lower")
    return upper, lower


EXAMPLES = sorted((Path(omnisim.__file__).parents[1] / "examples" / "optics").glob("*.toml"))
HYPERBOLA = Hyperbolic()
FISHEYE = EquidistantCamera(360, 360, 110.0, (179.5, 179.5), math.radians(80.0))
SYSTEMS = {
    "hyperbola": OpticalSystem(
        pinhole(1300.0), (Surface(HYPERBOLA, at(HYPERBOLA.vertex_m), 0.012),)
    ),
    "misaligned hyperbola": OpticalSystem(
        pinhole(1300.0), (Surface(HYPERBOLA, at(HYPERBOLA.vertex_m, 0.002, roll_deg=2.0), 0.012),)
    ),
    "sphere": OpticalSystem(pinhole(800.0), (Surface(Conic(0.03), at(0.15), 0.029),)),
    "tilted camera": OpticalSystem(
        pinhole(450.0),
        (Surface(Conic(0.1), at(0.3), 0.095),),
        system_from_camera=poses.pose((0.01, 0.0, 0.0), roll_deg=3.0, pitch_deg=-2.0, yaw_deg=1.0),
    ),
    "cone": OpticalSystem(pinhole(450.0), (Surface(Cone(50.0), at(0.12), 0.06),)),
    "asphere": OpticalSystem(
        pinhole(800.0), (Surface(Asphere(0.03, 0.0, (1e3,)), at(0.15), 0.028),)
    ),
    "polynomial": OpticalSystem(
        pinhole(800.0), (Surface(Polynomial((0.1, 16.0, 0.0, 4e3)), at(0.15, 0.001), 0.028),)
    ),
    "needle": OpticalSystem(
        pinhole(800.0),
        (Surface(Conic(0.03), at(0.15), 0.027),),
        (Rod((0.0, 0.0, 0.1), (0.0, 0.0, 0.151), 0.002, "needle"),),
    ),
    "concave": OpticalSystem(pinhole(200.0), (Surface(Conic(-0.3, -1.0), at(0.1), 0.1),)),
    "folded": OpticalSystem(pinhole(1000.0), folded()),
    "port": OpticalSystem(FISHEYE, port()),
    "tilted port": OpticalSystem(FISHEYE, port(roll_deg=10.0)),
    # its slope grows and falls again: points are seen twice
    "wave": OpticalSystem(
        pinhole(800.0), (Surface(Polynomial((0.0, 20.0, 0.0, -25e3)), at(0.15), 0.02),)
    ),
    "dome": OpticalSystem(FISHEYE, dome(0.004, 0.003)),
}  # fmt: skip
TILTED = poses.pose((0.01, -0.02, 0.003), roll_deg=0.3, pitch_deg=0.2, yaw_deg=0.1)
ALL = {
    **SYSTEMS,
    **{path.stem: read_optics_file(path) for path in EXAMPLES},
    "every key": dataclasses.replace(
        SYSTEMS["needle"], medium=(1.331, 1.333, 1.337), color="B", origin_m=(0.001, 0.002, 0.1),
        system_from_camera=TILTED, orientation=TILTED[:3, :3],
    ),
}  # fmt: skip
