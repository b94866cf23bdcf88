"""Visible shares of the objects in a sample, relative to their pixels without occluders."""

from __future__ import annotations

import numpy as np

from omnisim.core.world import WorldState
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.rays.depth_limits import DepthLimits
from omnisim.rendering.rays.pixel_rays import PixelRays
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.whole_instances import whole_areas_px
from omnisim.rendering.stage import Stage
from omnisim.rendering.truth.ground_truth import instances_of_draws
from omnisim.scene import Scene


class VisibleShares:
    """Calculator of visible shares in a camera's images, by casting rays through all surfaces.

    Args:
        camera: camera, as in its renderer.
    """

    def __init__(self, camera: OmniCamera):
        self._camera = camera
        self._pixels = PixelRays(camera.model, camera.mesh_polygons)
        self._limits = DepthLimits(camera.near_m, camera.far_m)

    def find(
        self, stage: Stage, rays: RayScene, frame: Frame, state: WorldState, vehicle: str
    ) -> dict[int, float]:
        """Shares of the visible instances, above 0 and at most 1, by ID.

        Args:
            stage: stage of the frame.
            rays: ray scene with the stage's scene and objects.
            frame: frame with the channel `instance`.
            state: world state of the frame.
            vehicle: vehicle of the camera.
        """
        assert frame.labels is not None
        instances = np.asarray(frame.channels["instance"])
        surfaces = [(one.object_index, one.name) for one in rays.caster.geometry.surfaces]
        ids = instances_of_draws(frame.labels, surfaces, list(stage.objects))
        whole_px = whole_areas_px(
            rays,
            self._pixels,
            self._limits,
            state.world_from_object[vehicle] @ self._camera.base_from_rig,
            ObjectState(stage.poses_in(state)),
            ids[1:],
            instances,
        )
        numbers, visible_px = np.unique(instances[instances > 0], return_counts=True)
        # at the rim a pixel may have a ray in the image only
        shares = np.minimum(visible_px / whole_px[numbers], 1.0)
        return dict(zip(numbers.tolist(), shares.tolist(), strict=True))


class StageRays:
    """Ray scene of a stage, rebuilt when its scene changes."""

    def __init__(self) -> None:
        self._built: tuple[Scene, RayScene] | None = None

    def of(self, stage: Stage) -> RayScene:
        """Ray scene of a stage's current scene.

        Raises:
            OmnisimError: embreex is not installed.
        """
        if self._built is None or self._built[0] is not stage.scene:
            self._built = stage.scene, RayScene(stage.scene, tuple(stage.objects.values()))
        return self._built[1]
