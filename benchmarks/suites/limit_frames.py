"""Frame of a scene, and its lower bound at the probes' rates."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.pipeline_parts import FrameCounts, PartSeconds, RepeatedFrame
from benchmarks.probes import fill, readback, submission, triangles
from benchmarks.probes.probe import Probe
from benchmarks.probes.small_faces import small_faces_name
from benchmarks.probes.surfaces import room_name
from benchmarks.seen_triangles import count_seen_triangles
from benchmarks.timer import Timings
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage

PARTS = PartSeconds._fields
_LIMITED = ("texels", "triangles", "lookups", "readback")


@dataclass(frozen=True, eq=False)
class LimitedFrame:
    """Frame of a scene at a quality setting, with its counts.

    Attributes:
        scene, setting: names of scene and quality setting.
        frame: frame to be timed.
        counts: draws of the frame.
        texels: texels of the virtual cameras: samples without overdraw.
        triangles_seen: number of triangles that the image shows.
        mirror_px, captured_px: number of valid pixels of the image, and of the supersampled image.
        image_bytes: size of the image to read back.
        part_seconds: seconds of the frame's parts, by round.
    """

    scene: str
    setting: str
    frame: RepeatedFrame
    counts: FrameCounts
    texels: int
    triangles_seen: int
    mirror_px: int
    captured_px: int
    image_bytes: int
    part_seconds: list[PartSeconds]

    @classmethod
    def of(
        cls,
        context: moderngl.Context,
        name: str,
        setting: str,
        stage: Stage,
        room: Stage,
        camera: OmniCamera,
    ) -> LimitedFrame:
        """Render a frame, and count its draws.

        Args:
            context: OpenGL context.
            name, setting: names of scene and quality setting.
            stage: stage with the scene.
            room: stage with an empty room.
            camera: camera at the quality setting.
        """
        frame = RepeatedFrame.at_start(stage, camera)
        image = frame.render()
        mirror_px = int(np.count_nonzero(image[..., 3]))
        in_room = RepeatedFrame.at_start(room, camera)
        texels = in_room.count().virtual_cameras.samples
        in_room.renderer.close()
        seen = count_seen_triangles(
            context,
            stage.scene,
            camera.model,
            frame.world_from_base @ camera.base_from_rig,
            round(camera.model.width_px * camera.texels_per_pixel),
            camera.near_m,
        )
        return cls(
            name, setting, frame, frame.count(), texels, seen,
            mirror_px, mirror_px * camera.supersampling**2, image.nbytes, [],
        )  # fmt: skip

    @property
    def name(self) -> str:
        """Name of the frame in the timings."""
        return f"{self.scene}, {self.setting}"

    def time_parts(self) -> None:
        """Render the frame by parts, and record their seconds."""
        self.part_seconds.append(self.frame.parts())

    def row(self, probes: Mapping[str, Probe], timings: Timings) -> dict[str, Any]:
        """Row of the report.

        Args:
            probes: probes by name.
            timings: times of the probes and of this frame.
        """
        whole = timings.seconds[self.name]
        # the rounds of the warm-up are recorded, too, and excluded here
        parts = dict(zip(PARTS, np.array(self.part_seconds[-len(whole) :]).T, strict=True))
        limits = self._limits(probes, timings.seconds)
        processor_limits = self._limits(probes, timings.processor_seconds)
        paired = Timings(
            {
                "whole": whole,
                "in parts": np.sum(list(parts.values()), axis=0),
                "after the faces": parts["capture"] + parts["readback"],
                "limit": np.sum(list(limits.values()), axis=0),
                "limit of virtual_cameras": limits["texels"] + limits["triangles"],
                "limit of capture": limits["lookups"],
                "limit of readback": limits["readback"],
                **parts,
            },
            {
                "whole": timings.processor_seconds[self.name],
                "limit": np.sum(list(processor_limits.values()), axis=0),
            },
        )
        faces = self.counts.virtual_cameras
        call = probes[submission.DRAW_WITH_STATE]
        calls_s = self.counts.calls / call.rates(timings.seconds[call.name])
        return {
            "kind": "frame", "scene": self.scene, "setting": self.setting,
            **timings.row(self.name),
            **{f"{part}_ms": paired.percentile_ms(part, 50) for part in PARTS},
            "small_faces_ms": timings.percentile_ms(small_faces_name(self.scene), 50),
            **paired.ratio("after the faces", "in parts").flat("after_faces_share"),
            "in_parts": paired.ratio("in parts", "whole").median,
            "limit_ms": paired.percentile_ms("limit", 50),
            **{f"limit_{name}_ms": 1e3 * float(np.median(limits[name])) for name in _LIMITED},
            **paired.ratio("limit", "whole").flat("share_of_limit"),
            **paired.processor_ratio("limit", "whole").flat("processor_share_of_limit"),
            **{
                f"{part}_share_of_limit": paired.ratio(f"limit of {part}", part).median
                for part in PARTS if part != "around"
            },
            "texels": self.texels,
            **dataclasses.asdict(faces),
            "triangles_seen": self.triangles_seen,
            "calls": self.counts.calls, "draws": self.counts.draws,
            "calls_ms": 1e3 * float(np.median(calls_s)),  # each with state of its own
            "mirror_px": self.mirror_px, "captured_px": self.captured_px,
            "texels_a_mirror_px": self.texels / self.mirror_px,
            "samples_a_mirror_px": faces.samples / self.mirror_px,
        }  # fmt: skip

    def _limits(
        self, probes: Mapping[str, Probe], seconds: Mapping[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.float64]]:
        """Minimum seconds (rounds,) of each of `_LIMITED`, at the rates of the same round.

        Args:
            probes: probes by name.
            seconds: seconds of the probes by round, by name.
        """

        def min_seconds(amount: float, name: str) -> NDArray[np.float64]:
            return amount / probes[name].rates(seconds[name])

        faces = self.counts.virtual_cameras
        inside = faces.triangles if faces.triangles_inside is None else faces.triangles_inside
        unseen = max(0, inside - self.triangles_seen)
        return {
            "texels": min_seconds(self.texels, room_name(self.scene)),
            "triangles": min_seconds(self.triangles_seen, triangles.VISIBLE)
            + min_seconds(unseen, triangles.TURNED_AWAY)
            + min_seconds(max(0, faces.triangles - inside), triangles.OUTSIDE),
            "lookups": min_seconds(self.captured_px, fill.lookup_name(fill.ATLAS, "bilinear")),
            "readback": min_seconds(
                self.image_bytes, readback.readback_name(4, readback.SIDES_PX[0])
            ),
        }
