"""Renderers of a plan's samples: a stage per scene and light, a renderer per camera."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from omnisim.core.errors import PlanError
from omnisim.core.world import WorldState
from omnisim.datasets.generate.draw import Draw, SampleIndices, draw, draw_indices
from omnisim.datasets.generate.plan import RejectTable
from omnisim.datasets.generate.plan_cameras import PlanRig
from omnisim.datasets.generate.plan_light import DrawnLight
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.setups import setup_light, setup_rig
from omnisim.datasets.generate.visible_shares import StageRays, VisibleShares
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.readback import Pending
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage

PROBE_PX = 48  # shorter side of the range images that judge samples of plans without ranges


@dataclass(frozen=True, eq=False)
class RenderedSample:
    """Rendered sample.

    Attributes:
        drawn: drawn inputs of the sample.
        frames: frames by camera name; a single camera's name is empty.
        light: drawn values of the light; empty: the scene's own light.
        shares: visible shares of instances, by camera name and instance ID; empty: not requested.
    """

    drawn: Draw
    frames: dict[str, Frame]
    light: dict[str, Any]
    shares: dict[str, dict[int, float]] = field(default_factory=dict)


class SampleRenderer:
    """Renderer of samples; fast for consecutive samples of one scene and rig.

    Args:
        prepared: prepared plan.
        device: EGL index of the GPU; None: the first.
    """

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
            rendered = self._attempt(draw(self._prepared, number, attempt))
            if isinstance(rendered, RenderedSample):
                return rendered
            reason = rendered
        raise PlanError(
            f"{self._prepared.path}: sample {number}: rejected {plan.reject.attempts} times, last "
            f"as {reason}: see [reject] and [viewpoints]"
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

    def _attempt(self, drawn: Draw) -> RenderedSample | str:
        """Render an attempt; return the reason if it is rejected."""
        stage, rig = self._open(drawn.indices)
        with stage.current():  # throughout, not image by image
            return self._render(drawn, stage, rig)

    def _render(self, drawn: Draw, stage: Stage, rig: _OpenRig) -> RenderedSample | str:
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
            pending[name] = renderer.submit(
                state,
                also=plan.channels,
                frame_number=drawn.number,
                exposure_ev=_exposure_ev(renderer, drawn),
            )
            if judges and (reason := rejected(pending[name].result(), plan.reject)):
                return reason
        frames = {name: one.result() for name, one in pending.items()}
        shares: dict[str, dict[int, float]] = {}
        if plan.min_visible is not None:
            rays = self._rays.of(stage)
            shares = {
                name: rig.visible_shares(name).find(stage, rays, frame, state, vehicle)
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
    """Renderers of a rig on a stage.

    Args:
        stage: stage of the renderers.
        cameras: cameras of the rig.
        setup: setup of the cameras.
        seed: seed of the cameras' noise.

    Attributes:
        cameras, setup: see the arguments.
        renderers: renderers by camera name.
    """

    def __init__(self, stage: Stage, cameras: PlanRig, setup: int, seed: int):
        self._stage, self.cameras, self.setup = stage, cameras, setup
        self.renderers = {
            name: stage.open(camera, seed=f"{seed} {name}")
            for name, camera in cameras.cameras.items()
        }
        self._shares: dict[str, VisibleShares] = {}

    def visible_shares(self, name: str) -> VisibleShares:
        """Calculator of visible shares in a camera's images, created on first use."""
        if name not in self._shares:
            self._shares[name] = VisibleShares(self.renderers[name].camera)
        return self._shares[name]

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


def _exposure_ev(renderer: Renderer, drawn: Draw) -> float | None:
    """Exposure of an image in stops; None: the camera's own."""
    exposure = renderer.camera.degradation.exposure
    return None if exposure is None or exposure.auto else exposure.ev + drawn.exposure_ev


def rejected(frame: Frame, rules: RejectTable) -> str:
    """Reason to reject a frame with ranges; empty: accepted."""
    has_ray = frame.valid if frame.has_ray is None else frame.has_ray
    ranges = np.asarray(frame.channels["range"])[has_ray]
    if not len(ranges):
        return "it has no pixel with a ray"
    hits = float(np.isfinite(ranges).mean())
    if hits < rules.min_hit_share:
        return f"{100 * hits:.0f} % of its pixels hit something: min_hit_share"
    near = float((ranges < rules.near_m).mean())
    if near > rules.max_near_share:
        return (
            f"{100 * near:.0f} % of its pixels are nearer than {rules.near_m:g} m: max_near_share"
        )
    return ""
