"""pyrender: another OpenGL rasterizer, which shares no code with omnisim.

It filters textures and edges in sRGB values, omnisim in linear light: pixels on edges differ by
design.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.scene.model import AlphaMode, Light, LightKind, Material, Mesh, Scene, Texture, Wrap

if TYPE_CHECKING:
    import pyrender

NEAR_M, FAR_M = 0.05, 300.0
# Half a turn about x: its camera looks along −z with y up, ours along z with y down.
_FLIP_V, _V_OFFSET = np.array([1.0, -1.0], dtype=np.float32), np.array([0.0, 1.0], dtype=np.float32)
OPTICAL_FROM_PYRENDER: Floats = np.diag([1.0, -1.0, -1.0, 1.0])


def rasterize(scene: Scene, camera: PerspectiveCamera, world_from_optical: Floats) -> Bytes:
    """A pinhole camera's image (height, width, 3), sRGB, in plain base colors.

    Args:
        scene: scene to render.
        world_from_optical: (4, 4) pose of the camera's optical frame.
    """
    import pyrender

    stage = pyrender_scene(scene)
    u, v = camera.principal_point_px
    focal = camera.focal_length_px
    # its pixels count from the corner of the first pixel
    pinhole = pyrender.IntrinsicsCamera(focal, focal, u + 0.5, v + 0.5, znear=NEAR_M, zfar=FAR_M)
    stage.add(pinhole, pose=world_from_optical @ OPTICAL_FROM_PYRENDER)
    renderer = pyrender.OffscreenRenderer(camera.width_px, camera.height_px)
    try:
        color, _ = renderer.render(stage, flags=pyrender.RenderFlags.FLAT)
    finally:
        renderer.delete()
    return color


def pyrender_scene(scene: Scene, lit: bool = False) -> pyrender.Scene:
    """Scene for pyrender, without a camera; with the scene's lights if `lit`.

    Unlit, pyrender takes colors as sRGB values, so linear colors are encoded; lit, it decodes
    textures itself. Lights are π times as strong as ours, and all surfaces rough and not metallic:
    diffuse light is then the same. pyrender has no unlit surfaces, and at most four lights of each
    kind.
    """
    import pyrender

    background = (*srgb_from_linear(scene.background), 1.0)
    stage = pyrender.Scene(bg_color=background, ambient_light=scene.lighting.ambient)
    textures: dict[int, pyrender.Texture] = {}
    meshes = [_mesh(scene, mesh, textures, lit) for mesh in scene.meshes]
    for instance in scene.instances:
        stage.add(meshes[instance.mesh], pose=instance.world_from_mesh)
    if lit:
        for light in scene.lighting.lights:
            _add_light(stage, light, np.pi * scene.lighting.exposure * light.intensity)
    return stage


def _add_light(stage: pyrender.Scene, light: Light, intensity: float) -> None:
    import pyrender

    world_from_light = np.eye(4)
    world_from_light[:3, 3] = light.position_m
    # its light is along −z, with any axes across
    across = np.eye(3)[np.argmin(np.abs(light.direction))]
    right = np.cross(across, light.direction)
    right /= np.linalg.norm(right)
    world_from_light[:3, :3] = np.stack(
        (right, np.cross(right, light.direction), -light.direction), axis=1
    )
    node: pyrender.Light
    if light.kind is LightKind.DIRECTIONAL:
        node = pyrender.DirectionalLight(light.color, intensity)
    elif light.kind is LightKind.POINT:
        node = pyrender.PointLight(light.color, intensity)
    else:
        inner, outer = np.arccos(light.cone_cosines)
        angles = {"innerConeAngle": inner, "outerConeAngle": outer}
        node = pyrender.SpotLight(light.color, intensity, **angles)
    stage.add(node, pose=world_from_light)


def _mesh(
    scene: Scene, mesh: Mesh, textures: dict[int, pyrender.Texture], lit: bool
) -> pyrender.Mesh:
    import pyrender

    coordinates = mesh.texture_coordinates
    if coordinates is not None:  # v points up there
        coordinates = coordinates * _FLIP_V + _V_OFFSET
    colors = mesh.colors
    if colors is not None and not lit:
        colors = np.concatenate((srgb_from_linear(colors[:, :3]), colors[:, 3:]), axis=1)
    primitive = pyrender.Primitive(
        positions=mesh.positions,
        normals=mesh.normals,
        texcoord_0=coordinates,
        color_0=None if colors is None else colors.astype(np.float32),
        indices=mesh.triangles,
        material=_material(scene.materials[mesh.material], textures, lit),
    )
    return pyrender.Mesh([primitive])


def _material(
    material: Material, textures: dict[int, pyrender.Texture], lit: bool
) -> pyrender.MetallicRoughnessMaterial:
    import pyrender

    *color, alpha = material.base_color
    factor, texture = (*(color if lit else srgb_from_linear(color)), alpha), None
    if material.texture is not None:
        in_texture = np.ones(3) if lit else np.array(color)  # factors of sRGB values would be wrong
        if id(material) not in textures:
            textures[id(material)] = _texture(material.texture, in_texture)
        factor = material.base_color if lit else (1.0, 1.0, 1.0, alpha)
        texture = textures[id(material)]
    modes = {AlphaMode.OPAQUE: "OPAQUE", AlphaMode.MASK: "MASK", AlphaMode.BLEND: "BLEND"}
    return pyrender.MetallicRoughnessMaterial(
        baseColorFactor=factor,
        metallicFactor=0.0,
        roughnessFactor=1.0,
        baseColorTexture=texture,
        emissiveFactor=[min(level, 1.0) if lit else 0.0 for level in material.emissive],
        alphaMode=modes[material.alpha_mode],
        alphaCutoff=material.alpha_cutoff,
        doubleSided=material.double_sided,
    )


def _texture(texture: Texture, factor: Floats) -> pyrender.Texture:
    import pyrender
    from OpenGL.GL import GL_CLAMP_TO_EDGE, GL_REPEAT

    pixels = texture.pixels
    if not np.all(factor == 1.0):
        colors = srgb_from_linear(linear_from_srgb(pixels[..., :3] / 255.0) * factor)
        encoded = np.rint(255.0 * colors).astype(np.uint8)
        pixels = np.concatenate((encoded, pixels[..., 3:]), axis=2)
    wraps = {Wrap.REPEAT: GL_REPEAT, Wrap.CLAMP_TO_EDGE: GL_CLAMP_TO_EDGE}
    sampler = pyrender.Sampler(wrapS=wraps[texture.wrap_u], wrapT=wraps[texture.wrap_v])
    return pyrender.Texture(source=pixels, source_channels="RGBA", sampler=sampler)
