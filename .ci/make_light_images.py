"""Render the image of light beside Mitsuba's: `python .ci/make_light_images.py FILE`.

Above, the courtyard: in even light, by a sun and a lamp without shadows, with them, and traced by
Mitsuba. In the middle, spheres around the camera under a clear sky, rougher from one to the next,
the outer ones of metal: drawn matte, with their gloss, and by Mitsuba. Both are through the paper's
mirror, of which Mitsuba traces a real one; prints how far its images and ours are apart. Below, a
fisheye behind a dome without and with the water's attenuation, fog, and a clear sky.
"""

import dataclasses
import sys
from pathlib import Path

import numpy as np

from omnisim import OmniCamera, load_scene, open_sensor
from omnisim.cameras.optics.system_file import read_optics_file
from omnisim.core.poses import pose
from omnisim.core.srgb import srgb8_from_linear
from omnisim.plots.contact_sheet import save_contact_sheet
from omnisim.scene.model import Fog, Instance, Material, Mesh, Scene, StartPose
from omnisim.validation.checks.lit_scenes import FOLDER
from omnisim.validation.checks.materials import ciede2000, lab_from_linear
from omnisim.validation.fixture import linear_image
from omnisim.validation.image_differences import psnr_db
from omnisim.validation.material_chart import BASE_COLOR, ROUGHNESS, sphere
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides
from omnisim.validation.traced_light import inside_rim, small_mirror, traced_light

ROOT = Path(__file__).resolve().parents[1]
SIZE_PX, SAMPLES = 300, 256  # squares, as Mitsuba's sampler wants
VIEWPOINT_M = (0.0, 0.0, 1.0)
RINGS = ((1.1, 0.25, 0.0), (2.3, 0.45, 1.0))  # distance, radius and metalness of the spheres
SENSOR = small_mirror(SIZE_PX)


def main(path: str) -> None:
    """Write the image."""
    inside = inside_rim(SENSOR)[..., None]
    tiles = [(title, np.where(inside, linear, 0.0)) for title, linear in (*courtyard(), *spheres())]
    shown = [
        (title, srgb8_from_linear(np.clip(linear, 0.0, 1.0)))
        for title, linear in (*tiles, *air_and_water())
    ]
    save_contact_sheet(Path(path), shown, columns=4)


def courtyard():
    """Titles and linear images (height, width, 3)."""
    plain = load_scene("courtyard", sky="none")
    lit = matte_on_both_sides(load_scene(FOLDER / "courtyard.toml"))
    bare = dataclasses.replace(lit, lighting=lit.lighting.with_shadows(False))
    at = SENSOR.base_pose(lit.start.position_m, yaw_deg=20.0)
    ours, traced = rendered(lit, at), traced_light(lit, SENSOR, at, SAMPLES)
    inside = inside_rim(SENSOR)
    print(f"courtyard: {psnr_db(traced, ours, inside):.1f} dB")
    return [
        ("even light", rendered(plain, at)),
        ("sun and lamp, no shadows", rendered(bare, at)),
        ("with shadows", ours),
        ("Mitsuba, direct light", traced),
    ]


def spheres():
    """Titles and linear images (height, width, 3)."""
    scene = ring_scene()
    matte = dataclasses.replace(scene, lighting=dataclasses.replace(scene.lighting, is_matte=True))
    even = dataclasses.replace(scene, lighting=load_scene("courtyard", sky="none").lighting)
    at = SENSOR.base_pose(VIEWPOINT_M)
    ours, traced = rendered(scene, at), traced_light(scene, SENSOR, at, SAMPLES)
    with open_sensor(scene, SENSOR) as renderer:
        truth = renderer.render(at, also=("instance",)).channels
    apart = ciede2000(lab_from_linear(ours), lab_from_linear(traced))
    print(f"spheres: mean CIEDE2000 {apart[truth['instance'] > 0].mean():.2f}")
    return [
        ("even light", rendered(even, at)),
        ("clear sky, matte", rendered(matte, at)),
        ("metal and gloss", ours),
        ("Mitsuba, principled", traced),
    ]


def air_and_water():
    """Titles and linear images (height, width, 3)."""
    courtyard = load_scene("courtyard", sky="none")
    lighting = dataclasses.replace(load_scene("rings", sky="clear").lighting, is_matte=True)
    sunny = dataclasses.replace(courtyard, lighting=lighting)
    water = Fog((0.0, 0.10, 0.14), (0.35, 0.07, 0.03))
    fog = Fog((0.6, 0.6, 0.6), (0.2, 0.2, 0.2))
    dome = OmniCamera(read_optics_file(ROOT / "examples" / "optics" / "dome-port.toml"))
    dome = dome.resized(SIZE_PX)
    ahead = dome.base_pose(courtyard.start.position_m, yaw_deg=90.0, pitch_deg=15.0)
    around = SENSOR.base_pose(courtyard.start.position_m, yaw_deg=20.0)
    return [
        ("behind a dome in water", rendered(courtyard, ahead, dome)),
        ("with its attenuation", rendered(in_fog(courtyard, water), ahead, dome)),
        ("fog, 15 m", rendered(in_fog(courtyard, fog), around)),
        ("clear sky", rendered(sunny, around)),
    ]


def in_fog(scene, fog):
    """Scene in fog."""
    return dataclasses.replace(scene, lighting=dataclasses.replace(scene.lighting, fog=fog))


def rendered(scene, at, sensor=SENSOR):
    """Linear image (height, width, 3)."""
    with open_sensor(scene, sensor) as renderer:
        return linear_image(renderer.render(at, linear=True))


def ring_scene() -> Scene:
    """Two rings of spheres around the camera, under a clear sky with its sun."""
    meshes, materials, instances = [], [], []
    for distance_m, radius_m, metallic in RINGS:
        shape = sphere(radius_m)
        for number, roughness in enumerate(ROUGHNESS):
            index = len(meshes)
            materials.append(
                Material(
                    "", (*BASE_COLOR, 1.0), metallic=metallic, roughness=roughness, specular=1.0
                )
            )
            meshes.append(Mesh("", shape.positions, shape.triangles, index, shape.normals))
            angle = 2.0 * np.pi * (number + 0.5 * metallic) / len(ROUGHNESS)
            x, y = distance_m * np.cos(angle), distance_m * np.sin(angle)
            placed = pose((x, y, radius_m))
            instances.append(Instance(f"sphere {index}", index, placed, placed))
    lighting = load_scene("rings", sky="clear").lighting
    return Scene(
        name="spheres",
        meshes=tuple(meshes),
        materials=tuple(materials),
        instances=tuple(instances),
        lighting=dataclasses.replace(lighting, is_matte=False),
        background=(0.0, 0.0, 0.0),
        start=StartPose(VIEWPOINT_M),
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
