"""Faces of the cube against pyrender: an independent rasterizer, unlit, same camera.

pyrender filters textures and edges in sRGB values, we filter in linear light, so the two differ by
design in every pixel that an edge crosses, and agree to a level or two elsewhere. Two views of it:
the images as they are, large enough that edges do not rule them, and both made four times as
large and averaged in linear light, which leaves the shapes and colors themselves to compare.
"""

import dataclasses
import functools
import sys

import numpy as np
import pytest
from PIL import Image

from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.mirror_mesh import unfold
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES, unfolded_cube
from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene import load_scene
from omnisim.scene.files.load import resolve_source
from omnisim.scene.formats.mesh.other_formats import write_mirror
from omnisim.validation.image_differences import psnr_of_levels_db
from tests.scenes import WAREHOUSE, with_warehouse

pytestmark = [
    pytest.mark.usefixtures("needs_opengl"),
    pytest.mark.skipif(sys.version_info >= (3, 12), reason="pyrender 0.1.45 needs Python < 3.12"),
    # pyrender 0.1.45 and its PyOpenGL date from 2021 and warn about today's NumPy and Python
    pytest.mark.filterwarnings("ignore"),
]
SIZE_PX = 1024
AVERAGED = 4


def _opaque_file(source, folder):
    """The scene's opaque part as a file of trimesh's, and as a scene of trimesh's.

    Drawn flat, pyrender blends in the order of nodes, and takes base colors for sRGB values.
    """
    trimesh = pytest.importorskip("trimesh")
    loaded = trimesh.load_scene(resolve_source(source).mesh_file)
    materials = {name: mesh.visual.material for name, mesh in loaded.geometry.items()}
    opaque = (None, "OPAQUE")
    loaded.delete_geometry(
        [n for n, material in materials.items() if material.alphaMode not in opaque]
    )
    for material in materials.values():
        if material.emissiveFactor is not None and any(material.emissiveFactor):
            material.baseColorFactor = [
                1.0,
                1.0,
                1.0,
                1.0,
            ]  # a lamp, which is black when drawn flat
    path = folder / "opaque.glb"
    path.write_bytes(loaded.export(file_type="glb"))
    return path, trimesh.load_scene(path)


def _pyrender_face(loaded, world_from_face):
    pyrender = pytest.importorskip("pyrender")
    scene = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 1.0))
    meshes = {
        name: pyrender.Mesh.from_trimesh(geometry) for name, geometry in loaded.geometry.items()
    }
    for material in {p.material for mesh in meshes.values() for p in mesh.primitives}:
        color = np.array(material.baseColorFactor, dtype=np.float64)
        material.baseColorFactor = (*srgb_from_linear(color[:3]), color[3])
    for node in loaded.graph.nodes_geometry:
        pose, name = loaded.graph[node]
        scene.add(meshes[name], pose=pose)
    # file axes: y up. pyrender's camera looks along −z with y up, ours along z with y down.
    file_from_world = np.eye(4)
    file_from_world[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    face_from_camera = np.diag([1.0, -1.0, -1.0, 1.0])
    camera = pyrender.PerspectiveCamera(yfov=np.pi / 2.0, aspectRatio=1.0, znear=0.05, zfar=200.0)
    scene.add(camera, pose=file_from_world @ world_from_face @ face_from_camera)
    renderer = pyrender.OffscreenRenderer(SIZE_PX, SIZE_PX)
    try:
        color, _ = renderer.render(scene, flags=pyrender.RenderFlags.FLAT)
    finally:
        renderer.delete()
    return color


def _averaged(image):
    blocks = linear_from_srgb(image / 255.0).reshape(
        SIZE_PX // AVERAGED, AVERAGED, SIZE_PX // AVERAGED, AVERAGED, 3
    )
    return 255.0 * srgb_from_linear(blocks.mean(axis=(1, 3)))


# The worst face, per pixel and averaged. Measured: 37.2 and 43.1 dB, 35.5 and 41.0 dB.
BOUNDS_DB = {"soccer": (36.0, 42.0), WAREHOUSE: (35.0, 39.0)}


@pytest.fixture(scope="module")
def our_faces(tmp_path_factory):
    """Function of a source: its faces by us, its scene of trimesh's, and the pose of the base."""

    @functools.cache
    def faces_of(source):
        path, loaded = _opaque_file(source, tmp_path_factory.mktemp("scene"))
        sensor = OmniCamera(face_size_px=SIZE_PX, samples=4)  # faces as smooth as theirs
        scene = dataclasses.replace(load_scene(path), background=(0.0, 0.0, 0.0))
        world_from_base = sensor.base_pose((1.0, -2.0, 1.2), yaw_deg=25.0)
        with open_sensor(scene, sensor, unlit=True) as renderer:
            renderer.render(world_from_base)
            return renderer.faces(), loaded, world_from_base

    return faces_of


@pytest.mark.slow
@pytest.mark.parametrize("name", ["front", "left", "back", "right", "down"])
@with_warehouse("soccer", long=True)
def test_face(source, name, our_faces):
    faces, loaded, world_from_base = our_faces(source)
    ours = faces[name]
    world_from_face = world_from_base.copy()
    world_from_face[:3, :3] @= FACE_FROM_RIG[FACE_NAMES.index(name)].T
    theirs = _pyrender_face(loaded, world_from_face)
    bound_db, averaged_bound_db = BOUNDS_DB[source]
    assert psnr_of_levels_db(ours, theirs) >= bound_db
    assert psnr_of_levels_db(_averaged(ours), _averaged(theirs)) >= averaged_bound_db


def test_exported_mirror_shows_our_image(tmp_path):
    """The paper's Fig. 6 by another renderer: the mirror's file, its texture coordinates,
    the five faces as its texture, and a pinhole camera at its focus make our capture."""
    pyrender = pytest.importorskip("pyrender")
    trimesh = pytest.importorskip("trimesh")
    sensor = OmniCamera(face_size_px=512, supersampling=1)  # as theirs: one look a pixel
    camera = sensor.model
    with open_sensor(load_scene("courtyard"), sensor, unlit=True) as renderer:
        ours = renderer.render(sensor.base_pose((0.5, 1.0, 0.9), yaw_deg=20.0))
        texture = unfolded_cube(renderer.faces())
    unfolded = unfold(camera.mirror, tessellate(camera.mirror, 1024))
    write_mirror(tmp_path / "mirror.glb", unfolded, "mirror")
    mesh = trimesh.load_mesh(tmp_path / "mirror.glb", process=False)
    mesh.visual.material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(texture)
    )
    scene = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 1.0))
    scene.add(pyrender.Mesh.from_trimesh(mesh, smooth=False))
    u, v = camera.principal_point_px
    pinhole = pyrender.IntrinsicsCamera(
        camera.focal_length_px, camera.focal_length_px, u + 0.5, v + 0.5, znear=0.01, zfar=1.0
    )
    # The file is y up: the mirror's (x, y, z) is stored as (x, z, −y). The camera sits at the
    # mirror's (0, 0, c), looks along its −z, and has its y at the top of the image.
    file_from_mirror = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    mirror_from_camera = np.eye(4)
    mirror_from_camera[2, 3] = camera.mirror.c_m
    scene.add(pinhole, pose=file_from_mirror @ mirror_from_camera)
    renderer = pyrender.OffscreenRenderer(camera.width_px, camera.height_px)
    try:
        theirs, _ = renderer.render(scene, flags=pyrender.RenderFlags.FLAT)
    finally:
        renderer.delete()
    # Inside the rim: there they have smooth edges and we have not. Theirs interpolates texture
    # coordinates linearly within a polygon, and blends in sRGB.
    inside = np.hypot(*(np.indices(ours.valid.shape)[::-1] - np.reshape((u, v), (2, 1, 1))))
    inside = inside < camera.rim_radius_px - 2.0
    assert psnr_of_levels_db(ours.rgb[inside], theirs[inside]) >= 30.0
