"""Picture of an object from outside: python -m scenes.modeling.portrait FILE.glb -o FILE.jpg.

One of omnisim's virtual cameras looks at it, on a floor without end on which light from all around
casts a soft shadow. Lengths are meters.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from omnisim.core.poses import pose
from omnisim.core.srgb import linear_from_srgb
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene import Scene, load_scene
from omnisim.scene.model import Instance, Material, Mesh, Texture, Wrap

BACKDROP = (0.80, 0.83, 0.86)  # sRGB
FACE_PX = 3200
FLOOR_HALF_M, FLOOR_PX = 1.6, 1024
SHADOW_LAMPS = 100


def main() -> None:
    """Take the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--heading", type=float, default=40.0, help="where it is seen from, deg")
    parser.add_argument("--elevation", type=float, default=20.0, help="deg above the floor")
    parser.add_argument("--distance", type=float, default=2.0, help="m from the middle")
    parser.add_argument("--middle", type=float, nargs=3, default=(0.0, 0.0, 0.29))
    parser.add_argument("--width", type=float, default=0.92, help="m across the middle")
    parser.add_argument("--aspect", type=float, default=1.0)
    parser.add_argument("--size", type=int, default=900, help="pixels across")
    asked = parser.parse_args()
    picture = portrait(
        load_scene(asked.file),
        np.array(asked.middle),
        asked.heading,
        asked.elevation,
        asked.distance,
        asked.width,
        asked.aspect,
    )
    size = (asked.size, round(asked.size / asked.aspect))
    picture.resize(size, Image.Resampling.LANCZOS).save(asked.output, quality=90)


def portrait(
    scene: Scene,
    middle: np.ndarray,
    heading_deg: float,
    elevation_deg: float,
    distance: float,
    width: float,
    aspect: float,
) -> Image.Image:
    """The part of the front camera's picture that shows the object."""
    out = pose(yaw_deg=heading_deg, pitch_deg=-elevation_deg)[:3, 0]
    at = pose(middle + distance * out, pitch_deg=elevation_deg, yaw_deg=heading_deg + 180)
    sensor = OmniCamera(face_size_px=FACE_PX)
    with open_sensor(on_floor(scene), sensor) as renderer:
        renderer.render(at)
        face = Image.fromarray(renderer.faces()["front"])
    half = FACE_PX / 2
    reach = half * width / 2 / distance  # 90 degrees across: half a face is as wide as far
    return face.crop(
        tuple(round(half + part) for part in (-reach, -reach / aspect, reach, reach / aspect))
    )


def on_floor(scene: Scene) -> Scene:
    """The scene on an unlit floor of the backdrop's color, with its shadow."""
    shade = Image.fromarray((255 * soft_shadow(scene)).astype(np.uint8))
    backdrop = np.array(BACKDROP)
    pixels = np.asarray(shade.filter(ImageFilter.GaussianBlur(8)), float)[..., None] / 255
    colors = np.concatenate([255 * backdrop * (1 - pixels), 255 + 0 * pixels], axis=2)
    texture = Texture(np.rint(colors).astype(np.uint8), Wrap.CLAMP_TO_EDGE, Wrap.CLAMP_TO_EDGE)
    far = 30 * FLOOR_HALF_M
    corners = np.array([(-far, -far), (far, -far), (far, far), (-far, far)], np.float32)
    floor = Mesh(
        "floor",
        np.column_stack([corners, np.zeros(4, np.float32)]),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        len(scene.materials),
        texture_coordinates=(0.5 + corners / (2 * FLOOR_HALF_M)).astype(np.float32),
    )
    linear = tuple(linear_from_srgb(backdrop).tolist())
    return replace(
        scene,
        meshes=(*scene.meshes, floor),
        materials=(*scene.materials, Material("floor", texture=texture, unlit=True)),
        instances=(*scene.instances, Instance("floor", len(scene.meshes), np.eye(4))),
        background=linear,
    )


def soft_shadow(scene: Scene) -> np.ndarray:
    """Shadow on the floor's texels, 0..1: share of light lost; rows along y, columns along x.

    Lamps stand all around in the upper half of the sky; each casts the triangles onto the floor.
    """
    corners = []
    for instance in scene.instances:
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_mesh
        world = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        corners.append(world[mesh.triangles])
    triangles = np.concatenate(corners)
    total = np.zeros((FLOOR_PX, FLOOR_PX))
    for index in range(SHADOW_LAMPS):
        azimuth = index * np.pi * (3 - np.sqrt(5))  # spread like the seeds of a sunflower
        slope = np.sqrt((index + 0.5) / SHADOW_LAMPS) * 1.1
        shift = slope * np.array([np.cos(azimuth), np.sin(azimuth)])
        cast = triangles[..., :2] + triangles[..., 2:] * shift
        pixels = (0.5 + cast / (2 * FLOOR_HALF_M)) * FLOOR_PX
        canvas = Image.new("1", (FLOOR_PX, FLOOR_PX))
        draw = ImageDraw.Draw(canvas)
        for triangle in pixels.reshape(-1, 6).tolist():
            draw.polygon(triangle, fill=1)
        total += np.asarray(canvas, float)
    return 0.62 * total / SHADOW_LAMPS


if __name__ == "__main__":
    main()
