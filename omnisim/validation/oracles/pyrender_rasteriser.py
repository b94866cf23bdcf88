"""pyrender: another rasteriser, on OpenGL too, that shares no code with ours.

It filters textures and edges in sRGB values, ours in linear light: pixels that an edge crosses
differ by design.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.scene.model import AlphaMode, Material, Mesh, Scene, Texture, Wrap
from omnisim.srgb import linear_from_srgb, srgb_from_linear

NEAR_M, FAR_M = 0.05, 300.0
# Half a turn about x: its camera looks along −z with y up, ours along z with y down.
OPTICAL_FROM_PYRENDER: NDArray[np.float64] = np.diag([1.0, -1.0, -1.0, 1.0])


def rasterise(
    scene: Scene, camera: PerspectiveCamera, world_from_optical: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """A pinhole camera's picture (height, width, 3), sRGB, in plain base colours.

    Args:
        scene: what there is to see.
        camera: the pinhole camera.
        world_from_optical: (4, 4) pose of its optical frame.
    """
    import pyrender

    stage = pyrender.Scene(bg_color=(*srgb_from_linear(scene.background), 1.0))
    textures: dict[int, pyrender.Texture] = {}
    meshes = [_mesh(scene, mesh, textures) for mesh in scene.meshes]
    for instance in scene.instances:
        stage.add(meshes[instance.mesh], pose=instance.world_from_mesh)
    u, v = camera.principal_point_px
    focal = camera.focal_length_px
    # its pixels count from the corner of the first one
    pinhole = pyrender.IntrinsicsCamera(focal, focal, u + 0.5, v + 0.5, znear=NEAR_M, zfar=FAR_M)
    stage.add(pinhole, pose=world_from_optical @ OPTICAL_FROM_PYRENDER)
    renderer = pyrender.OffscreenRenderer(camera.width_px, camera.height_px)
    try:
        color, _ = renderer.render(stage, flags=pyrender.RenderFlags.FLAT)
    finally:
        renderer.delete()
    return color


def _mesh(scene: Scene, mesh: Mesh, textures: dict[int, object]) -> object:
    import pyrender

    coordinates = mesh.texture_coordinates
    if coordinates is not None:  # v runs up there
        coordinates = coordinates * np.float32([1.0, -1.0]) + np.float32([0.0, 1.0])
    colors = mesh.colors
    if colors is not None:
        colors = np.concatenate((srgb_from_linear(colors[:, :3]), colors[:, 3:]), axis=1)
    primitive = pyrender.Primitive(
        positions=mesh.positions,
        normals=mesh.normals,
        texcoord_0=coordinates,
        color_0=None if colors is None else colors.astype(np.float32),
        indices=mesh.triangles,
        material=_material(scene.materials[mesh.material], textures),
    )
    return pyrender.Mesh([primitive])


def _material(material: Material, textures: dict[int, object]) -> object:
    """It takes factors for sRGB values, so ours is worked into the texture or encoded."""
    import pyrender

    *color, alpha = material.base_color
    factor, texture = (*srgb_from_linear(color), alpha), None
    if material.texture is not None:
        if id(material) not in textures:
            textures[id(material)] = _texture(material.texture, np.array(color))
        factor, texture = (1.0, 1.0, 1.0, alpha), textures[id(material)]
    modes = {AlphaMode.OPAQUE: "OPAQUE", AlphaMode.MASK: "MASK", AlphaMode.BLEND: "BLEND"}
    return pyrender.MetallicRoughnessMaterial(
        baseColorFactor=factor,
        baseColorTexture=texture,
        alphaMode=modes[material.alpha_mode],
        alphaCutoff=material.alpha_cutoff,
        doubleSided=material.double_sided,
    )


def _texture(texture: Texture, factor: NDArray[np.float64]) -> object:
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
