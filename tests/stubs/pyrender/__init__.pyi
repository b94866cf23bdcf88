from collections.abc import Sequence
from enum import IntFlag

import numpy as np
from numpy.typing import ArrayLike, NDArray

class Node: ...
class Camera: ...

class IntrinsicsCamera(Camera):
    def __init__(
        self, fx: float, fy: float, cx: float, cy: float, znear: float = ..., zfar: float = ...
    ) -> None: ...

class PerspectiveCamera(Camera):
    def __init__(
        self,
        yfov: float,
        znear: float = ...,
        zfar: float | None = ...,
        aspectRatio: float | None = ...,
    ) -> None: ...

class Light: ...

class DirectionalLight(Light):
    def __init__(self, color: ArrayLike, intensity: float) -> None: ...

class PointLight(Light):
    def __init__(self, color: ArrayLike, intensity: float) -> None: ...

class SpotLight(Light):
    def __init__(
        self, color: ArrayLike, intensity: float, *, innerConeAngle: float, outerConeAngle: float
    ) -> None: ...

class Sampler:
    def __init__(self, *, wrapS: int, wrapT: int) -> None: ...

class Texture:
    def __init__(
        self, *, source: NDArray[np.uint8], source_channels: str, sampler: Sampler
    ) -> None: ...

class MetallicRoughnessMaterial:
    def __init__(
        self,
        *,
        baseColorFactor: ArrayLike,
        metallicFactor: float,
        roughnessFactor: float,
        emissiveFactor: list[float] = ...,
        baseColorTexture: Texture | None,
        alphaMode: str,
        alphaCutoff: float,
        doubleSided: bool,
    ) -> None: ...

class Primitive:
    def __init__(
        self,
        *,
        positions: NDArray[np.float32],
        normals: NDArray[np.float32] | None,
        texcoord_0: NDArray[np.float32] | None,
        color_0: NDArray[np.float32] | None,
        indices: NDArray[np.uint32],
        material: MetallicRoughnessMaterial,
    ) -> None: ...

class Mesh:
    def __init__(self, primitives: Sequence[Primitive]) -> None: ...

class Scene:
    def __init__(self, *, bg_color: ArrayLike, ambient_light: ArrayLike) -> None: ...
    def add(self, obj: Camera | Light | Mesh, *, pose: NDArray[np.float64] = ...) -> Node: ...
    def set_pose(self, node: Node, pose: NDArray[np.float64]) -> None: ...

class RenderFlags(IntFlag):
    NONE = ...
    FLAT = ...

class OffscreenRenderer:
    viewport_width: int
    viewport_height: int
    def __init__(self, viewport_width: int, viewport_height: int) -> None: ...
    def render(
        self, scene: Scene, flags: RenderFlags = ...
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]: ...
    def delete(self) -> None: ...
