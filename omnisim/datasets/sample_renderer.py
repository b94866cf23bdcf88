"""Renderers of a plan's samples: one stage for each scene, one renderer for each camera on it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from omnisim.datasets.draw import Draw, Which, draw, draw_which
from omnisim.datasets.plan import RejectTable
from omnisim.datasets.prepared_plan import PreparedPlan
from omnisim.errors import PlanError
from omnisim.frame import Frame
from omnisim.sensors import Renderer, Stage
from omnisim.world import WorldState

PROBE_PX = 48  # shorter side of the ranges that judge a sample whose plan has no ranges


class SampleRenderer:
    """Renders samples; those of one scene and rig one after the other are quick.

    Args:
        prepared: plan.
        device: EGL's number of the GPU; None takes the first.
    """

    def __init__(self, prepared: PreparedPlan, device: int | None = None):
        self._prepared, self._device = prepared, device
        self._stage: Stage | None = None
        self._scene = -1
        self._renderers: dict[int, dict[str, Renderer]] = {}
        self._probes: dict[int, Renderer] = {}

    def order(self, numbers: range) -> list[int]:
        """Numbers of samples in the order in which to render them."""

        def key(number: int) -> tuple[int, int, int]:
            which = draw_which(self._prepared.plan, number)
            return which.scene, which.rig, number

        return sorted(numbers, key=key)

    def render(self, number: int) -> tuple[Draw, dict[str, Frame]]:
        """Render a sample, drawn again until it is not rejected.

        Returns:
            Its draw, and the frames by camera; a single camera's name is empty.

        Raises:
            PlanError: all attempts were rejected.
        """
        plan, reason = self._prepared.plan, ""
        for attempt in range(plan.reject.attempts):
            drawn = draw(self._prepared, number, attempt)
            frames, reason = self._attempt(drawn)
            if not reason:
                return drawn, frames
        raise PlanError(
            f"{self._prepared.path}: sample {number}: rejected {plan.reject.attempts} times, last "
            f"as {reason}: see [reject] and [stand]"
        )

    def close(self) -> None:
        """Close the stage and its renderers."""
        for renderer in self._open_renderers():
            renderer.close()
        self._renderers.clear()
        self._probes.clear()
        if self._stage is not None:
            self._stage.close()
        self._stage, self._scene = None, -1

    def _open_renderers(self) -> list[Renderer]:
        own = [one for rig in self._renderers.values() for one in rig.values()]
        return own + list(self._probes.values())

    def _attempt(self, drawn: Draw) -> tuple[dict[str, Frame], str]:
        """Frames of a draw, and the reason for which it is rejected; empty: it is not."""
        plan = self._prepared.plan
        stage, renderers = self._open(drawn.which)
        scene = self._prepared.scene(drawn.which.scene)
        first = self._prepared.rigs[drawn.which.rig].first
        base = first.base_pose(drawn.position_m, drawn.yaw_deg, drawn.pitch_deg, drawn.roll_deg)
        base[:3, 3] += base[:3, :3] @ drawn.shift_m
        for name, color in drawn.colors.items():
            scene = scene.recolored(name, color)
        for placed in drawn.objects:
            shape = self._prepared.objects[placed.object].scene
            scene = scene.added(placed.name, shape, placed.world_from_object)
        if scene is not stage.scene:
            stage.scene = scene
        vehicle = next(iter(renderers.values())).vehicle
        state = WorldState({vehicle: base}, drawn.time_s)
        if "range" not in plan.channels and plan.reject.is_needed:
            probe = self._probe(drawn.which).render(state, also=("range",))
            if reason := rejected(probe, plan.reject):
                return {}, reason
        frames: dict[str, Frame] = {}
        for name, renderer in renderers.items():
            frame = renderer.render(state, also=plan.channels, frame_number=drawn.number)
            judges = not frames and "range" in plan.channels
            if judges and (reason := rejected(frame, plan.reject)):
                return {}, reason
            frames[name] = frame
        return frames, ""

    def _open(self, which: Which) -> tuple[Stage, Mapping[str, Renderer]]:
        if self._stage is None or which.scene != self._scene:
            self.close()
            self._stage = Stage(self._prepared.scene(which.scene), device=self._device)
            self._scene = which.scene
        if which.rig not in self._renderers:
            seed = self._prepared.plan.seed
            self._renderers[which.rig] = {
                name: Renderer(self._stage, camera, seed=f"{seed} {name}")
                for name, camera in self._prepared.rigs[which.rig].cameras.items()
            }
        return self._stage, self._renderers[which.rig]

    def _probe(self, which: Which) -> Renderer:
        if which.rig not in self._probes:
            assert self._stage is not None
            camera = self._prepared.rigs[which.rig].first
            size_px = min(PROBE_PX, camera.model.width_px, camera.model.height_px)
            self._probes[which.rig] = Renderer(self._stage, camera.resized(size_px))
        return self._probes[which.rig]


def rejected(frame: Frame, rules: RejectTable) -> str:
    """Reason for which a frame with ranges is rejected; empty: it is not."""
    has_ray = frame.valid if frame.has_ray is None else frame.has_ray
    ranges = np.asarray(frame.channels["range"])[has_ray]
    if not len(ranges):
        return "it has no pixel with a ray"
    hits = float(np.isfinite(ranges).mean())
    if hits < rules.least_hits:
        return f"{100 * hits:.0f} % of its pixels hit something: least_hits"
    near = float((ranges < rules.near_m).mean())
    if near > rules.most_near:
        return f"{100 * near:.0f} % of its pixels are nearer than {rules.near_m:g} m: most_near"
    return ""
