"""Renderers of a plan's samples: a stage per scene and light, a renderer per camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.core.pending import Pending
from omnisim.core.world import WorldState
from omnisim.datasets.generate.distributions import RandomStream
from omnisim.datasets.generate.draw import Draw, SampleIndices, draw, draw_indices
from omnisim.datasets.generate.plan import RejectTable
from omnisim.datasets.generate.plan_cameras import DrawnLight, PlanRig, draw_light
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.pixel_rays import PixelRays
from omnisim.rendering.rays.caster import DepthLimits
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.scene_rays import whole_areas_px
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage
from omnisim.rendering.truth import instances_of_draws
from omnisim.scene import Scene

PROBE_PX = 48  # shorter side of the range images that judge samples of plans without ranges


@dataclass(frozen=True, eq=False)
class RenderedSample:
    """Rendered sample."""

    drawn: Draw  # drawn inputs of the sample
    frames: dict[str, Frame]  # frames by camera name; a single camera's name is empty
    light: dict[str, Any]  # drawn values of the light; empty: the scene's own light
    # visible shares of instances, by camera name and instance ID; empty: not requested
    shares: dict[str, dict[int, float]] = field(default_factory=dict)


class SampleRenderer:
    """Renderer of samples; fast for consecutive samples of one scene and rig."""

    def __init__(self, prepared: PreparedPlan, device: int | None = None):
        self._prepared, self._device = prepared, device
        self._stage: Stage | None = None
        self._opened = (-1, -1)  # scene and setup of the light
        self._light: DrawnLight | None = None
        self._rays = StageRays()
        self._rigs: dict[int, _OpenRig] = {}

    def order(self, numbers: range) -> list[int]:
        """Numbers of samples in rendering order: equal scenes, lights and cameras in succession."""

        def key(number: int) -> tuple[int, ...]:
            indices = draw_indices(self._prepared.plan, number)
            return indices.scene, indices.light, indices.rig, indices.camera, number

        return sorted(numbers, key=key)

    def render(self, number: int) -> RenderedSample:
        """Render a sample; rejected attempts are drawn again.

        Raises:
            OmnisimError: an attempt could not be drawn, or all attempts were rejected.
        """
        plan, reason = self._prepared.plan, ""
        for attempt in range(plan.reject.attempts):
            drawn = draw(self._prepared, number, attempt)
            stage, rig = self._open(drawn.indices)
            with stage.current():  # throughout, not image by image
                rendered = self._render(drawn, stage, rig)
            if isinstance(rendered, RenderedSample):
                return rendered
            reason = rendered
        raise PlanError(
            f"{self._prepared.path}: sample {number}: rejected {plan.reject.attempts} times, at "
            f"last because {reason}: see [reject] and [viewpoints]"
        )

    def close(self) -> None:
        """Close the stage and its renderers."""
        for rig in self._rigs.values():
            rig.close()
        self._rigs.clear()
        if self._stage is not None:
            self._stage.close()
        self._stage, self._light, self._opened = None, None, (-1, -1)
        self._rays = StageRays()

    def _render(self, drawn: Draw, stage: Stage, rig: _OpenRig) -> RenderedSample | str:
        """Render an attempt; return the reason if it is rejected."""
        plan = self._prepared.plan
        assert self._light is not None
        scene, first = self._light.scene, rig.cameras.first
        base = first.base_pose(
            drawn.position_m,
            yaw_deg=drawn.yaw_deg,
            pitch_deg=drawn.pitch_deg,
            roll_deg=drawn.roll_deg,
        )
        base[:3, 3] += base[:3, :3] @ drawn.shift_m
        for name, color in drawn.colors.items():
            scene = scene.recolored(name, color)
        for placed in drawn.objects:
            shape = self._prepared.objects[placed.object].scene
            scene = scene.added(placed.name, shape, placed.world_from_object)
        if scene is not stage.scene:
            stage.scene = scene
        vehicle = next(iter(rig.renderers.values())).vehicle
        state = WorldState({vehicle: base}, drawn.time_s)
        if "range" not in plan.channels and plan.reject.is_needed:
            probe = rig.probe.render(state, also=("range",))
            if reason := rejected(probe, plan.reject):
                return reason
        pending: dict[str, Pending[Frame]] = {}
        for name, renderer in rig.renderers.items():
            judges = not pending and "range" in plan.channels
            own = renderer.camera.degradation.exposure  # None, or metered: not to be set
            ev = None if own is None or own.auto else own.ev + drawn.exposure_ev
            pending[name] = renderer.submit(
                state, also=plan.channels, frame_number=drawn.number, exposure_ev=ev
            )
            if judges and (reason := rejected(pending[name].result(), plan.reject)):
                return reason
        frames = {name: reading.result() for name, reading in pending.items()}
        shares: dict[str, dict[int, float]] = {}
        if plan.min_visible is not None:
            rays = self._rays.of(stage)
            shares = {
                name: rig.visible_shares[name].find(stage, rays, frame, state, vehicle)
                for name, frame in frames.items()
            }
        return RenderedSample(drawn, frames, self._light.values, shares)

    def _open(self, indices: SampleIndices) -> tuple[Stage, _OpenRig]:
        prepared = self._prepared
        if self._stage is None or self._opened != (indices.scene, indices.light):
            self.close()
            self._light = setup_light(prepared, indices.scene, indices.light)
            self._stage = Stage(self._light.scene, device=self._device)
            self._opened = indices.scene, indices.light
        if indices.rig in self._rigs and self._rigs[indices.rig].setup != indices.camera:
            self._rigs.pop(indices.rig).close()
        if indices.rig not in self._rigs:
            cameras = setup_rig(prepared, indices.rig, indices.camera)
            self._rigs[indices.rig] = _OpenRig(
                self._stage, cameras, indices.camera, prepared.plan.seed
            )
        return self._stage, self._rigs[indices.rig]


class _OpenRig:
    """Renderers of a rig, with the cameras of a setup, on a stage; by camera name."""

    def __init__(self, stage: Stage, cameras: PlanRig, setup: int, seed: int):
        self._stage, self.cameras, self.setup = stage, cameras, setup
        self.renderers = {
            name: stage.open(camera, seed=f"{seed} {name}")
            for name, camera in cameras.cameras.items()
        }

    @cached_property
    def visible_shares(self) -> dict[str, VisibleShares]:
        """Calculators of visible shares in the cameras' images."""
        return {name: VisibleShares(renderer.camera) for name, renderer in self.renderers.items()}

    @cached_property
    def probe(self) -> Renderer:
        """Renderer of small range images, to judge samples of plans without the channel range."""
        camera = self.cameras.first
        size_px = min(PROBE_PX, camera.model.width_px, camera.model.height_px)
        return self._stage.open(camera.resized(size_px))

    def close(self) -> None:
        """Close the renderers."""
        for renderer in self.renderers.values():
            renderer.close()
        if "probe" in self.__dict__:
            self.probe.close()


def rejected(frame: Frame, rules: RejectTable) -> str:
    """Reason to reject a frame with ranges; empty: accepted."""
    has_ray = frame.valid if frame.has_ray is None else frame.has_ray
    ranges = np.asarray(frame.channels["range"])[has_ray]
    if not len(ranges):
        return "it has no pixel with a ray"
    hits = float(np.isfinite(ranges).mean())
    if hits < rules.min_hit_share:
        return f"only {100 * hits:.0f} % of its rays hit a surface (min_hit_share)"
    near = float((ranges < rules.near_m).mean())
    if near > rules.max_near_share:
        return f"{100 * near:.0f} % of its rays hit within {rules.near_m:g} m (max_near_share)"
    return ""


# Setups: light and cameras shared by successive samples, as functions of seed and number.
#
# Opening a scene under another light, or opening another camera, takes as long as rendering
# several images. A setup therefore lasts for `vary.images_per_setup` images. Invalid setups are
# drawn again.


_LIGHT, _CAMERA = 16, 32  # purposes of streams, above those of samples: one per rig
ATTEMPTS = 20
T = TypeVar("T")


def setup_light(prepared: PreparedPlan, scene: int, setup: int) -> DrawnLight:
    """Scene of the plan with the light of a setup.

    Raises:
        OmnisimError: a faulty scene, or no valid light was drawn.
    """
    vary, own = prepared.plan.vary, prepared.scene(scene)
    if not vary.lights:
        return DrawnLight(own, {})
    return _draw(
        prepared, setup, _LIGHT, lambda stream: draw_light(own, vary, stream, prepared.path)
    )


def setup_rig(prepared: PreparedPlan, rig: int, setup: int) -> PlanRig:
    """Rig of the plan with the parameters of a setup.

    Raises:
        OmnisimError: a faulty file of the rig, or no valid parameters were drawn.
    """
    file = prepared.rig_files[rig]
    if not file.table.varies:
        return prepared.rigs[rig]
    return _draw(prepared, setup, _CAMERA + rig, file.rig)


def _draw(prepared: PreparedPlan, setup: int, purpose: int, make: Callable[[RandomStream], T]) -> T:
    """Result of `make` with the first stream that gives a valid one."""
    fault = ""
    for attempt in range(ATTEMPTS):
        try:
            return make(RandomStream(prepared.plan.seed, setup, attempt, purpose))
        except OmnisimError as reason:
            fault = str(reason).partition("\n")[0]
    raise PlanError(f"{fault} (setup {setup}, drawn {ATTEMPTS} times)")


# Visible shares of the objects in a sample, relative to their pixels without occluders.


class VisibleShares:
    """Calculator of visible shares in a camera's images, by casting rays through all surfaces."""

    def __init__(self, camera: OmniCamera):
        self._camera = camera
        self._pixels = PixelRays(camera.model, camera.mesh_polygons)
        self._limits = DepthLimits(camera.near_m, camera.far_m)

    def find(
        self, stage: Stage, rays: RayScene, frame: Frame, state: WorldState, vehicle: str
    ) -> dict[int, float]:
        """Shares of the instances visible in a vehicle's frame, above 0 and at most 1, by ID.

        The ray scene has the stage's scene and objects; the frame has the channel `instance`.
        """
        assert frame.labels is not None
        instances = np.asarray(frame.channels["instance"])
        drawn = rays.caster.geometry.surfaces
        surfaces = [(surface.object_index, surface.name) for surface in drawn]
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
