"""Back-end interface: renders images and intersects rays.

A back end has three classes: its side of the scene, one per stage; its side of a camera; and a
`HitSource`. `omnisim.rendering.shared_scene` opens back ends by name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from omnisim.core.extras import missing_packages
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.label_names import Labels
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.readback import FrameRequest, Pending, Readback, ScenePoses, SubFrames
from omnisim.scene import Scene
from omnisim.scene.labels import BODY, find_labels
from omnisim.scene.specular_materials import has_specular

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.ground_truth.hits import HitDetails
    from omnisim.ground_truth.lidar_beams import BeamHits, EchoLimits, LidarBeams, Revolution
    from omnisim.rendering.camera.degraded_camera import DegradedCamera
    from omnisim.rendering.hit_source import HitSource
    from omnisim.rendering.rays.ray_scene import RayScene
    from omnisim.rendering.truth.ground_truth import GroundTruth


@dataclass(frozen=True, eq=False)
class CameraSetup:
    """Camera in a scene.

    Attributes:
        sensor: the camera.
        unlit: show plain base colors.
        hidden: parts of the vehicle that are left out.
        seed: seed of its noise.
        vehicles: names of the objects that are vehicle bodies.
    """

    sensor: OmniCamera
    unlit: bool = False
    hidden: frozenset[ObjectPart] = frozenset()
    seed: int | str = 0
    vehicles: tuple[str, ...] = (BODY,)


class LabelCache:
    """Labels of a scene, cached until names or rules change."""

    def __init__(self) -> None:
        self._found: tuple[object, Labels] | None = None

    def find(self, scene: Scene, objects: Mapping[str, Scene], vehicles: Collection[str]) -> Labels:
        """Labels of all instances, see `find_labels`; objects and vehicles must stay the same."""
        of = scene.instance_names, scene.labels
        if self._found is None or self._found[0] != of:
            self._found = of, find_labels(scene, objects, vehicles)
        return self._found[1]


def seen_background(scene: Scene, unlit: bool) -> tuple[float, float, float]:
    """Linear RGB of rays that hit nothing: the fog's color, unless base colors are shown."""
    return scene.background if unlit else scene.lighting.background(scene.background)


class CameraBackend(ABC):
    """Renders the images of one camera, and intersects its rays."""

    def __init__(self, world: SceneBackend, setup: CameraSetup):
        self.world, self.setup = world, setup
        self._degraded: DegradedCamera | None = None
        self._ground_truth: tuple[HitSource, GroundTruth] | None = None
        self._labels = LabelCache()

    @abstractmethod
    def refresh(self) -> None:
        """Adapt to the scene after its objects or buffers have changed."""

    def begin(self, request: FrameRequest) -> Pending[tuple[Readback, dict[str, Any]]]:
        """Begin to render an image, to be returned with the metadata of its degradation."""
        if self._degraded is None:
            return self._begin_ideal(request).then(lambda image: (image, {}))
        taken = self._degraded.begin(request)
        return taken.then(lambda image: (image[0], {"degradation": image[1]}))

    @abstractmethod
    def _begin_ideal(self, request: FrameRequest) -> Pending[Readback]:
        """Begin to render an image without degradation."""

    def _degrade(self, begin: Callable[[SubFrames], Pending[Readback]]) -> None:
        """Degrade all further images, and render them from sub-frames."""
        from omnisim.rendering.camera.degraded_camera import DegradedCamera
        from omnisim.rendering.truth.moving_boxes import MovingBoxes

        boxes = MovingBoxes(self.world.scene, self.world.objects.values())
        self._degraded = DegradedCamera(self.setup.sensor, self.setup.seed, begin, boxes)

    def begin_batch(
        self, poses: Sequence[ScenePoses], out: NDArray[np.uint8], frame_number: int = 0
    ) -> Pending[None]:
        """Begin to render images from poses at rest; by default one after the other.

        Args:
            poses: poses of the camera and the objects, one entry per image.
            out: (n, height, width, 3 or 4), contiguous.
            frame_number: number of the first image.

        Returns:
            Result that waits until `out` is filled.
        """
        for number, one in enumerate(poses):
            request = FrameRequest(one, None, False, frame_number + number, None)
            out[number] = self.begin(request).result()[0].rgba[..., : out.shape[-1]]
        return Pending(lambda: None)

    @abstractmethod
    def hit_source(self, details: HitDetails) -> HitSource:
        """Source of ground truth's hits, with at least these details; created on first use."""

    @abstractmethod
    def faces(self, poses: ScenePoses) -> dict[str, NDArray[np.float32]]:
        """Linear images (size, size, 3) of the virtual cameras, by name.

        Raises:
            GraphicsError: the back end has no virtual cameras.
        """

    def ground_truth(self, names: Collection[str]) -> GroundTruth:
        """Ground truth that includes these channels."""
        from omnisim.ground_truth.hits import HitDetails
        from omnisim.rendering.truth.ground_truth import GroundTruth

        source = self.hit_source(HitDetails.of_channels(names))
        if self._ground_truth is None or self._ground_truth[0] is not source:
            truth = GroundTruth(source, self._find_labels(), list(self.world.objects))
            self._ground_truth = source, truth
        return self._ground_truth[1]

    def _refresh_ground_truth(self) -> None:
        if self._ground_truth is not None:
            self._ground_truth[1].refresh(self._find_labels())

    def _find_labels(self) -> Labels:
        return self._labels.find(self.world.scene, self.world.objects, self.setup.vehicles)


class RangeFinder(Protocol):
    """Casts a scanner's beams."""

    def refresh(self) -> None:
        """Adapt to the scene after its objects or buffers have changed."""

    def cast(
        self,
        world_from_scanner: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> NDArray[np.float64]:
        """Ranges (n,) in m from a pose (4, 4), with the objects at their poses; +inf: no hit."""


class BeamCaster(Protocol):
    """Casts a spinning lidar's beams."""

    @property
    def draws(self) -> Sequence[ObjectPart]:
        """Dynamic object and name of each instance, indexed by `BeamHits.draw_ids` − 1."""

    def refresh(self) -> None:
        """Adapt to the scene after its objects or buffers have changed."""

    def cast(self, revolution: Revolution) -> BeamHits:
        """Hits of all beams of a revolution."""


class SceneBackend(ABC):
    """Scene and dynamic objects, ready for cameras."""

    def __init__(self, scene: Scene, objects: Mapping[str, Scene]):
        self.scene, self.objects = scene, objects
        self._specular: tuple[Scene, bool] | None = None

    @property
    @abstractmethod
    def is_open(self) -> bool:
        """False after `close`."""

    @property
    @abstractmethod
    def renderer(self) -> str:
        """Name of the renderer; others round differently."""

    @abstractmethod
    def current(self) -> AbstractContextManager[None]:
        """Make the back end current for a `with` block.

        Raises:
            GraphicsError: the back end is closed.
        """

    @abstractmethod
    def update(self, scene: Scene) -> None:
        """Replace the static scene by one with the same lights and background.

        Unchanged parts are not loaded again, if the back end can. Cameras must `refresh`.
        """

    def follows_specular(self) -> bool:
        """True if the scene has glass or mirrors, and embreex is installed to follow beams."""
        if self._specular is None or self._specular[0] is not self.scene:
            self._specular = self.scene, has_specular(self.scene, self.objects.values())
        return self._specular[1] and not missing_packages("rays")

    @abstractmethod
    def ray_scene(self) -> RayScene:
        """Scene to cast rays at, in its current state.

        Raises:
            OmnisimError: embreex is not installed.
        """

    @abstractmethod
    def camera(self, setup: CameraSetup) -> CameraBackend:
        """Camera in the scene.

        Raises:
            OmnisimError: a camera that this back end cannot render, by name.
        """

    @abstractmethod
    def range_finder(
        self,
        angles_rad: NDArray[np.float64],
        max_range_m: float,
        hidden: frozenset[ObjectPart],
        limits: EchoLimits | None = None,
    ) -> RangeFinder:
        """Beams of a scanner.

        Args:
            angles_rad: (n,) in the scanner's frame, counter-clockwise from its x axis.
            max_range_m: range beyond which surfaces may be missed; may be infinite.
            hidden: parts of the vehicle that beams pass through.
            limits: limits of echoes behind glass and mirrors; None: beams end at them.
        """

    @abstractmethod
    def beam_caster(self, beams: LidarBeams, hidden: frozenset[ObjectPart]) -> BeamCaster:
        """Beams of a spinning lidar, which pass through hidden parts of the vehicle."""

    @abstractmethod
    def close(self) -> None:
        """Free all memory; a second time does nothing."""
