"""The capture: what the camera's picture shows, from the atlas of virtual cameras."""

from __future__ import annotations

from enum import Enum

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, HyperbolicCamera, MirroredCamera
from omnisim.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.gpu.atlas.tile_plan import MAX_TILES, TilePlan
from omnisim.gpu.shader_files import build_program, included_files
from omnisim.gpu.uniforms import columns_first
from omnisim.mirrors import MirrorMesh

SEARCH = "camera/parts/theta_from_radius.glsl"
STORED_RAYS_BINDING = 7  # as in `capture/stored_rays.frag`


class Emit(Enum):
    """What a capture writes for each pixel; the value is the defines of `capture/emit.glsl`."""

    COLOR = ()
    RAY = ("EMIT_RAY",)
    LOOKUP = ("EMIT_LOOKUP",)

    @property
    def defines(self) -> tuple[str, ...]:
        """Of the capture's program."""
        return self.value


class LensCapture:
    """The exact capture: every pixel's ray by the camera model's GLSL file.

    Rays do not depend on the camera's pose. Where the model's file searches for them, step by
    step, they are kept, so that one lens costs about as much as another; where a formula gives
    them, that is quicker than to fetch them.
    """

    def __init__(self, context: moderngl.Context, camera: CentralCamera, emit: Emit = Emit.COLOR):
        self._stored_rays = None
        if emit not in (Emit.RAY, Emit.LOOKUP) and searches_for_rays(camera.model_name):
            self._stored_rays = _stored_rays(context, camera)
        if self._stored_rays is None:
            self.program = _model_program(context, camera, emit)
        else:
            self.program = build_program(
                context, "common/full_screen.vert", "capture/stored_rays.frag", emit.defines
            )
            self.program["u_width_px"] = camera.width_px
        self._vertex_array = context.vertex_array(self.program, [])

    def draw(self) -> None:
        """DrawItem into the framebuffer in use."""
        if self._stored_rays is not None:
            self._stored_rays.bind_to_storage_buffer(STORED_RAYS_BINDING)
        self._vertex_array.render(moderngl.TRIANGLES, vertices=3)


def searches_for_rays(model: str) -> bool:
    """Whether a model's GLSL file finds a ray step by step."""
    return SEARCH in included_files(f"camera/{model}.glsl")


def _model_program(
    context: moderngl.Context, camera: CentralCamera, emit: Emit
) -> moderngl.Program:
    mirrored = ("MIRRORED",) if isinstance(camera, MirroredCamera) else ()
    program = build_program(
        context,
        "common/full_screen.vert",
        "capture/lens.frag",
        defines=emit.defines + mirrored,
        includes={"CAMERA_MODEL": f"camera/{camera.model_name}.glsl"},
    )
    for name, value in camera.uniforms().items():
        program[name] = value
    return program


def _stored_rays(context: moderngl.Context, camera: CentralCamera) -> moderngl.Buffer | None:
    """Rays and validity of all pixels, four floats each, row by row; None: they do not fit."""
    size = (camera.width_px, camera.height_px)
    count = 16 * size[0] * size[1]
    if count > context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]:
        return None
    if max(size) > context.info["GL_MAX_TEXTURE_SIZE"]:
        return None  # whoever draws the picture says so
    try:
        stored = context.buffer(reserve=count)
        drawn = context.renderbuffer(size, 4, dtype="f4")
    except moderngl.Error:
        return None
    target = context.framebuffer([drawn])
    context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
    target.use()
    program = _model_program(context, camera, Emit.RAY)
    context.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    target.read_into(stored, components=4, dtype="f4")
    return stored


class MirrorMeshCapture:
    """The capture of a mirror's mesh by the pinhole camera that looks at it."""

    def __init__(
        self,
        context: moderngl.Context,
        camera: HyperbolicCamera,
        mesh: MirrorMesh,
        emit: Emit = Emit.COLOR,
    ):
        self.program = build_program(
            context,
            "capture/mirror_mesh.vert",
            "capture/mirror_mesh.frag",
            defines=emit.defines,
        )
        self.program["u_picture_size_px"] = (camera.width_px, camera.height_px)
        self.program["u_focal_length_px"] = camera.focal_length_px
        self.program["u_principal_point_px"] = camera.principal_point_px
        positions = (mesh.vertices_m / camera.mirror.c_m).astype("<f4")
        self._vertex_array = context.vertex_array(
            self.program,
            [(context.buffer(positions), "3f4", "in_position")],
            context.buffer(mesh.triangles.astype("<u4")),
            index_element_size=4,
        )

    def draw(self) -> None:
        """DrawItem into the framebuffer in use."""
        self._vertex_array.render(moderngl.TRIANGLES)


Capture = LensCapture | MirrorMeshCapture


def connect_cube(
    program: moderngl.Program, plan: TilePlan, rig_from_optical: NDArray[np.float64]
) -> None:
    """Tell a capture's program where in the atlas each tile stands (`cube_faces.glsl`)."""
    cores, windows, places = (np.zeros((MAX_TILES, 4), dtype=np.float32) for _ in range(3))
    texels = np.zeros(MAX_TILES, dtype=np.float32)
    atlas_px = np.array([plan.width_px, plan.height_px], dtype=np.float64)
    for number, tile in enumerate(plan.tiles):
        half_px = 0.5 * tile.face_size_px
        middle_px = np.array(tile.face_corner_px) + half_px
        places[number] = np.concatenate((middle_px / atlas_px, half_px / atlas_px))
        cores[number] = np.ravel(tile.region)
        windows[number] = tile.padded_region.ravel()
        texels[number] = half_px
    face_of_tile = [tile.face for tile in plan.tiles]
    first_tiles = np.searchsorted(face_of_tile, np.arange(len(FACE_NAMES) + 1))
    if "u_atlas" in program:  # what only says where to look does not look itself
        program["u_atlas"] = 0
    if "u_max_level" in program:  # what is no colour has no mip levels
        program["u_max_level"] = float(plan.max_level)
        program["u_level_bias"] = plan.level_bias
    for name, values in (
        ("u_rig_from_optical", columns_first(rig_from_optical)),
        ("u_face_from_rig", columns_first(FACE_FROM_RIG)),
        ("u_first_tile", first_tiles.astype("<i4")),
        ("u_tile_core", cores),
        ("u_tile_window", windows),
        ("u_tile_place", places),
        ("u_tile_texels", texels),
    ):
        if name in program:
            program[name].write(values)
