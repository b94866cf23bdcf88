"""Stage of a built Genesis scene: its rigid entities, with the meshes that Genesis draws."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.errors import SceneError
from omnisim.core.extras import require_extra
from omnisim.core.poses import pose_from_rotation, rotation_type
from omnisim.core.world import Motion, WorldState
from omnisim.follow.body_shapes import Shape, shape_scene
from omnisim.follow.body_stage import BodyStage
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene import Scene
from omnisim.scene.formats.imported_scene import unique_name


class GenesisStage(BodyStage):
    """Stage whose objects are the links of a Genesis scene, named `entity/link`.

    Meshes have their colors and textures, and are matte. Soft bodies and liquids are not drawn.

    Args:
        scene: `genesis.Scene`, built; its environments are worlds.
        surroundings: what else stands still, and the lights.
        device, backend: as for `omnisim.Stage`.

    Raises:
        OmnisimError: Genesis is not installed.
        SceneError: a scene that is not built, or has nothing to draw.
    """

    def __init__(
        self,
        scene: Any,
        surroundings: Scene | str | Path | None = None,
        *,
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        require_extra("genesis", "omnisim.follow.GenesisStage")
        if not scene.is_built:
            raise SceneError("scene: expected one that is built: call scene.build() before")
        self._host, self._solver = scene, scene.sim.rigid_solver
        used = set[str]()
        names = [
            unique_name(f"{link.entity.name}/{link.name}", used, first=2)
            for link in self._solver.links
        ]
        shapes = {
            name: shape_scene(name, _shapes(link))
            for name, link in zip(names, self._solver.links, strict=True)
            if link.vgeoms
        }
        if not shapes:
            raise SceneError("scene: expected rigid entities to draw, got none")
        still = shape_scene("", ()) if surroundings is None else surroundings
        super().__init__(still, shapes, names=names, device=device, backend=backend)

    def now(self) -> WorldState:
        """State of the scene, or of its first environment."""
        return self.worlds_now()[0]

    def worlds_now(self) -> list[WorldState]:
        """States of all environments.

        Raises:
            OmnisimError: a link has a pose that is not finite.
        """
        of = self._solver
        return self.states(
            _batched(of.get_links_pos()), _batched(of.get_links_quat()), self._time_s
        )

    def motion_now(self) -> Motion:
        """Motion of the scene, or of its first environment, by its current velocities."""
        of = self._solver
        positions, quaternions, linear, angular = (
            _batched(values)[0]
            for values in (
                of.get_links_pos(), of.get_links_quat(), of.get_links_vel(), of.get_links_ang(),
            )
        )  # fmt: skip
        velocities = {"linear": linear, "angular": angular}
        return self.motion(positions, quaternions, **velocities, time_s=self._time_s)

    @property
    def _time_s(self) -> float:
        return float(self._host.sim.cur_t)


def _batched(values: Any) -> Any:
    """Tensor (links, n) or (environments, links, n) as an array with environments."""
    array = values.detach().cpu().numpy()
    return array if array.ndim == 3 else array[None]


def _shapes(link: Any) -> Iterator[Shape]:
    """Meshes that Genesis draws for a link."""
    for geom in link.vgeoms:
        mesh, turn = geom.desc.vmesh, np.asarray(geom.desc.quat)[[1, 2, 3, 0]]
        pose = pose_from_rotation(rotation_type().from_quat(turn).as_matrix(), geom.desc.pos)
        surface = (mesh.verts, mesh.faces, mesh.normals)
        texture, uv = mesh.surface.get_rgba(), mesh.uvs
        image = getattr(texture, "image_array", None)
        if image is not None and uv is not None:
            factor = np.asarray(texture.image_color, dtype=float)
            flipped = np.column_stack((uv[:, 0], 1.0 - uv[:, 1]))
            yield Shape(surface, pose, factor, flipped, np.asarray(image, np.uint8), True)
        else:
            color = np.clip(getattr(texture, "color", (0.8, 0.8, 0.8)), 0.0, 1.0)
            yield Shape(surface, pose, color, double_sided=True)
