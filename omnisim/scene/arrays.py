"""Validation of arrays passed from Python, and the meshes and materials made from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.errors import OmnisimError, SceneError
from omnisim.core.poses import check_pose
from omnisim.core.srgb import linear_from_srgb8
from omnisim.scene.formats.imported_scene import PLAIN_GRAY, ImportedScene, make_mesh
from omnisim.scene.parts import AlphaMode, Instance, Material, Texture

_BYTE = np.dtype(np.uint8)


def import_arrays(
    name: str,
    vertices_m: ArrayLike,
    triangles: ArrayLike,
    normals: ArrayLike | None,
    uv: ArrayLike | None,
    colors: ArrayLike | None,
    texture: ArrayLike | None,
    base_color: ArrayLike | None,
    double_sided: bool,
) -> ImportedScene:
    """Import one instance; the arguments are those of `Scene.from_arrays`.

    Raises:
        SceneError: an array is invalid; names the instance, the expected and the actual value.
    """
    vertices = _numbers(name, "vertices_m", vertices_m, ("n", 3))
    corners = _numbers(name, "triangles", triangles, ("m", 3))
    if not (len(corners) and (corners == np.floor(corners)).all()):
        raise SceneError(f"instance {name!r}: triangles: expected whole numbers (m, 3), m ≥ 1")
    count = len(vertices)
    coordinates = None if uv is None else _numbers(name, "uv", uv, (count, 2))
    if texture is not None and coordinates is None:
        raise SceneError(f"instance {name!r}: texture: expected uv beside it, got none")
    mesh, center = make_mesh(
        name,
        vertices,
        corners,
        0,
        None if normals is None else _numbers(name, "normals", normals, (count, 3)),
        coordinates,
        None if colors is None else _vertex_colors(name, colors, count),
    )
    if base_color is None:
        is_plain = colors is None and texture is None
        base_color = [PLAIN_GRAY if is_plain else 1.0] * 3
    like = Material(name, double_sided=double_sided)
    material = color_material(name, base_color, texture, like)
    world_from_mesh = np.eye(4)
    world_from_mesh[:3, 3] = center
    return ImportedScene((mesh,), (material,), (Instance(name, 0, world_from_mesh),), [])


def color_material(
    name: str, base_color: ArrayLike, texture: ArrayLike | None, like: Material
) -> Material:
    """Material of a linear RGB or RGBA color multiplied by a texture.

    Args:
        name: instance name, for errors.
        base_color: (3,) or (4,), from 0 to 1.
        texture: (height, width, 3 or 4) uint8 sRGB; None: no texture.
        like: material that supplies the name, `double_sided` and `unlit`.

    Raises:
        SceneError: a value is invalid; names the instance, the expected and the actual value.
    """
    rgba = _numbers(name, "base_color", base_color, None)
    if rgba.shape not in ((3,), (4,)) or rgba.min() < 0.0 or rgba.max() > 1.0:
        raise SceneError(
            f"instance {name!r}: base_color: expected three or four numbers from 0 to 1, "
            f"got {rgba.tolist()}"
        )
    red, green, blue, alpha = (*rgba.tolist(), 1.0)[:4]
    image = None if texture is None else _texture(name, texture)
    mode = AlphaMode.BLEND
    if alpha == 1.0:
        from omnisim.scene.textures import alpha_mode_of  # with Pillow, slow to import

        mode = alpha_mode_of(image)
    return Material(
        like.name,
        (red, green, blue, alpha),
        image,
        mode,
        double_sided=like.double_sided,
        unlit=like.unlit,
    )


def instance_pose(name: str, matrix: ArrayLike) -> NDArray[np.float64]:
    """Checked pose (4, 4) of an instance.

    Raises:
        SceneError: a value is invalid; names the instance, the expected and the actual value.
    """
    checked = _numbers(name, "pose", matrix, (4, 4))
    try:
        return check_pose(checked)
    except OmnisimError as reason:
        raise SceneError(f"instance {name!r}: {reason}") from None


def _texture(name: str, texture: ArrayLike) -> Texture:
    pixels = np.asarray(texture)
    if (
        pixels.dtype != _BYTE
        or pixels.ndim != 3
        or pixels.shape[2] not in (3, 4)
        or not pixels.size
    ):
        raise SceneError(
            f"instance {name!r}: texture: expected (height, width, 3 or 4) uint8, "
            f"got {pixels.shape} {pixels.dtype}"
        )
    rgba = np.full((*pixels.shape[:2], 4), 255, dtype=np.uint8)
    rgba[..., : pixels.shape[2]] = pixels
    return Texture(rgba)


def _vertex_colors(name: str, colors: ArrayLike, count: int) -> NDArray[np.float64]:
    """Linear RGBA (n, 4) from sRGB bytes or from linear numbers in [0, 1]."""
    width = 4 if np.shape(colors)[-1:] == (4,) else 3
    values = _numbers(name, "colors", colors, (count, width))
    if np.asarray(colors).dtype == _BYTE:
        values = np.concatenate(
            (linear_from_srgb8(np.asarray(colors)[:, :3]), values[:, 3:] / 255.0), axis=1
        )
    if values.size and (values.min() < 0.0 or values.max() > 1.0):
        raise SceneError(
            f"instance {name!r}: colors: expected uint8, or numbers from 0 to 1, "
            f"got {values.min():g} to {values.max():g}"
        )
    rgba = np.ones((count, 4))
    rgba[:, :width] = values
    return rgba


def _numbers(
    name: str, key: str, values: ArrayLike, shape: tuple[str | int, ...] | None
) -> NDArray[np.float64]:
    """Validated array of finite numbers; a letter in `shape` means any length."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(
            f"instance {name!r}: {key}: expected numbers, got {values!r:.40}"
        ) from None
    if shape is not None and (
        array.ndim != len(shape)
        or any(got != n for got, n in zip(array.shape, shape, strict=True) if isinstance(n, int))
    ):
        expected = "(" + ", ".join(map(str, shape)) + ")"
        raise SceneError(f"instance {name!r}: {key}: expected {expected}, got {array.shape}")
    if not np.isfinite(array).all():
        raise SceneError(f"instance {name!r}: {key}: expected finite numbers, got NaN or infinity")
    return array
