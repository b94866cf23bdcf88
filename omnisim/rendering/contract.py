"""Contract between renderer and back ends, without OpenGL: requests, results, hits of rays.

A back end has three classes: its side of the scene, one per stage; its side of a camera; and a
`HitSource`. `omnisim.rendering.shared_scene` opens back ends by name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Bools, Bytes, Floats, Floats32, Indices, Uints32
from omnisim.core.errors import OpticsError
from omnisim.core.extras import missing_packages
from omnisim.core.pending import Pending
from omnisim.core.world import ObjectPart, time_of
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits, ThroughHits
from omnisim.ground_truth.label_names import Labels
from omnisim.rendering.camera.degradations.effect import MAX_EV
from omnisim.rendering.camera.degradations.image_geometry import Metering
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene import Scene
from omnisim.scene.labels import BODY, find_labels
from omnisim.scene.model import Mesh
from omnisim.scene.planar_mirrors import has_specular

if TYPE_CHECKING:
    from omnisim.ground_truth.hits import BeamHits, LidarBeams, Revolution, ScanBeams
    from omnisim.rendering.pixel_rays import Band


class Readback(NamedTuple):
    """Rendered image; top row first."""

    rgba: Bytes  # (height, width, 4): sRGB, alpha 255 where the camera sees something
    linear: Floats32 | None  # (height, width, 3), on request
    luminance: float | None = None  # of the light meter, if there is one


Taken = tuple[Readback, dict[str, Any]]  # an image, and metadata of it


class ScenePoses(NamedTuple):
    """Poses of the camera and of all dynamic objects at one time.

    Attributes:
        world_from_rig: (4, 4) pose of the camera's rig.
        world_from_objects: (4, 4) each, in the order of the stage's objects.
    """

    world_from_rig: Floats
    world_from_objects: Sequence[Floats] = ()

    @property
    def viewpoint_m(self) -> Floats:
        """Origin (3,) of the rig, world."""
        return self.world_from_rig[:3, 3]

    @property
    def time_s(self) -> float:
        """Time of the objects' poses, s; 0 if they have none."""
        return time_of(self.world_from_objects)


class SubFrame(NamedTuple):
    """Part of an image's exposure time.

    Attributes:
        poses: poses in this part.
        row_weights: (height,) share of each row's exposure; None: the whole exposure.
    """

    poses: ScenePoses
    row_weights: Floats32 | None = None


class ImageExposure(NamedTuple):
    """Exposure of one image.

    Attributes:
        factors: factors of red, green and blue light.
        frame_number: seeds the noise, which differs between frames.
    """

    factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    frame_number: int = 0


class SubFrames(NamedTuple):
    """Sub-frames of an image, and its exposure.

    Attributes:
        parts: sub-frames, at least one.
        expose: function from the metered luminance to the exposure.
        meter: light meter that measures the luminance for `expose`; None: not measured.
        linear: also return linear colors.
        frame_number: number of the frame, part of the key of its random numbers.
        is_exposed: the exposure does not depend on the luminance, which is only reported.
    """

    parts: Sequence[SubFrame]
    expose: Callable[[float | None], ImageExposure] = lambda luminance: ImageExposure()
    meter: Metering | None = None
    linear: bool = False
    frame_number: int = 0
    is_exposed: bool = False


class FrameStatistics(NamedTuple):
    """Numbers of triangles behind one image.

    Attributes:
        submitted: triangles of all instances that the camera may see, before culling.
        drawn: triangles that culling leaves for the virtual cameras, once per tile that draws them;
            0 if the back end draws none. Shadow maps, mirrored views and probes are left out.
        seen: different triangles that the rays of the pixels hit first.
    """

    submitted: int
    drawn: int
    seen: int


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """Request of one image; see also `omnisim.rendering.renderer.Renderer.render`.

    Attributes:
        poses: poses in the middle of the frame.
        motion: poses by seconds after the middle of the frame; None: at rest.
        linear: also return linear colors.
        frame_number: seeds the noise, which differs between frames.
        exposure_ev: exposure instead of auto-exposure; None: metered.

    Raises:
        OpticsError: an impossible exposure, or any for a camera without auto-exposure.
    """

    poses: ScenePoses
    motion: Callable[[float], ScenePoses] | None
    linear: bool
    frame_number: int
    exposure_ev: float | None

    def __post_init__(self) -> None:
        ev = self.exposure_ev
        if ev is not None and not abs(ev) <= MAX_EV:  # NaN fails, too
            raise OpticsError(f"exposure_ev: expected −{MAX_EV:g} to {MAX_EV:g} stops, got {ev:g}")


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


class Truth(Protocol):
    """Ground truth made from a source's hits, see `omnisim.rendering.truth`."""

    def refresh(self, labels: Labels) -> None:
        """Update labels and instances from the source."""


class Passes(Protocol):
    """Passes of one sensor."""

    def refresh(self) -> None:
        """Adapt to the scene after its objects or buffers have changed."""


class CameraBackend(ABC):
    """Renders the images of one camera, and intersects its rays.

    Attributes:
        truth: source of its ground truth, and what `ground_truth_of` has made of it; None: nothing.
    """

    def __init__(self, world: SceneBackend, setup: CameraSetup):
        self.world, self.setup = world, setup
        # takes images of a degraded camera; None: an ideal one
        self._degraded: Callable[[FrameRequest], Pending[Taken]] | None = None
        self.truth: tuple[HitSource, Truth] | None = None
        self._labels = LabelCache()

    @abstractmethod
    def refresh(self) -> None:
        """Adapt to the scene after its objects or buffers have changed."""

    def begin(self, request: FrameRequest) -> Pending[Taken]:
        """Begin to render an image, to be returned with the metadata of its degradation."""
        if self._degraded is None:
            return self._begin_ideal(request).then(lambda image: (image, {}))
        taken = self._degraded(request)
        return taken.then(lambda image: (image[0], {"degradation": image[1]}))

    @abstractmethod
    def _begin_ideal(self, request: FrameRequest) -> Pending[Readback]:
        """Begin to render an image without degradation."""

    def begin_batch(
        self, poses: Sequence[ScenePoses], out: Bytes, frame_number: int = 0
    ) -> Pending[None]:
        """Begin to render images from poses at rest; by default one after the other.

        Args:
            poses: poses of the camera and the objects, one entry per image.
            out: (n, height, width, 3 or 4), contiguous.
            frame_number: number of the first image.

        Returns:
            Result that waits until `out` is filled.
        """
        for number, pose in enumerate(poses):
            request = FrameRequest(pose, None, False, frame_number + number, None)
            out[number] = self.begin(request).result()[0].rgba[..., : out.shape[-1]]
        return Pending(lambda: None)

    @abstractmethod
    def hit_source(self, details: HitDetails) -> HitSource:
        """Source of ground truth's hits, with at least these details; created on first use."""

    def count_drawn(self, poses: ScenePoses) -> int:
        """Draw an image once more, and count the triangles that its virtual cameras draw."""
        return 0

    def statistics(self, poses: ScenePoses) -> FrameStatistics:
        """Numbers of triangles behind an image."""
        parts = [(None, self.world.scene), *enumerate(self.world.objects.values())]
        submitted = sum(
            len(part.meshes[instance.mesh].triangles)
            for index, part in parts
            for instance in part.instances
            if (index, instance.name) not in self.setup.hidden
        )
        hits = self.hit_source(NO_DETAILS).hits(poses)
        shown = np.stack((hits.draw_ids, hits.triangles), axis=-1)[hits.draw_ids > 0]
        seen = np.unique(shown.view("<u8"))  # a pair is one number
        return FrameStatistics(submitted, self.count_drawn(poses), len(seen))

    @abstractmethod
    def faces(self, poses: ScenePoses) -> dict[str, Floats32]:
        """Linear images (size, size, 3) of the virtual cameras, by name.

        Raises:
            GraphicsError: the back end has no virtual cameras.
        """

    def _refresh_truth(self) -> None:
        if self.truth is not None:
            self.truth[1].refresh(self.find_labels())

    def find_labels(self) -> Labels:
        """Labels of all instances."""
        return self._labels.find(self.world.scene, self.world.objects, self.setup.vehicles)


class RangeFinder(Passes, Protocol):
    """Casts a scanner's beams."""

    def cast(self, world_from_scanner: Floats, world_from_objects: Sequence[Floats] = ()) -> Floats:
        """Ranges (n,) in m from a pose (4, 4), with the objects at their poses; +inf: no hit."""


class BeamCaster(Passes, Protocol):
    """Casts a spinning lidar's beams."""

    @property
    def draws(self) -> Sequence[ObjectPart]:
        """Dynamic object and name of each instance, indexed by `BeamHits.draw_ids` − 1."""

    def cast(self, revolution: Revolution) -> BeamHits:
        """Hits of all beams of a revolution."""


class CameraRays(Protocol):
    """Rays of one camera's pixels, which pass the parts of its vehicle that it does not see.

    `numbers` are the draw IDs of instances that are drawn. All methods raise an OmnisimError if
    embreex is not installed.
    """

    def radiance(
        self, poses: ScenePoses, origins_m: Floats, directions: Floats, footprints: Floats32
    ) -> Floats32:
        """Linear RGB (n, 3) along rays (n,), rig frame, with footprints (n, 2, 3)."""

    def hits(
        self,
        poses: ScenePoses,
        band: Band,
        viewpoint_m: Floats,
        numbers: Mapping[ObjectPart, int],
        details: HitDetails,
    ) -> Hits:
        """Hits (n,) of a band's rays, with points relative to a viewpoint (3,), world."""

    def occluded(
        self,
        poses: ScenePoses,
        starts_m: Floats,
        points_m: Floats,
        draw_ids: Uints32,
        triangles: Uints32,
        numbers: Mapping[ObjectPart, int],
    ) -> Bools:
        """Mask (n,) of the points of hits that rays from starts (n, 3) do not reach.

        Args:
            starts_m, points_m: (n, 3) viewpoint frame; directions where nothing is hit.
            draw_ids, triangles: (n,) as in `Hits`.
        """

    def through(
        self, poses: ScenePoses, hits: Hits, is_specular: Bools, numbers: Mapping[ObjectPart, int]
    ) -> ThroughHits:
        """Surfaces behind glass and after mirrors, given the first hits.

        Args:
            is_specular: (draws,) mask of the instances that are glass or mirrors.
        """


class PlacedMesh(NamedTuple):
    """Object, name, pose as bytes and number of triangles of an instance, which identify it."""

    object_index: int | None
    name: str
    object_from_mesh: bytes
    triangles: int


class BeamSource(ABC):
    """Opens the beams of sensors at a scene."""

    @abstractmethod
    def range_finder(self, beams: ScanBeams, hidden: frozenset[ObjectPart]) -> RangeFinder:
        """Beams of a scanner, which pass through hidden parts of the vehicle."""

    @abstractmethod
    def beam_caster(self, beams: LidarBeams, hidden: frozenset[ObjectPart]) -> BeamCaster:
        """Beams of a spinning lidar, which pass through hidden parts of the vehicle."""


class SceneRays(BeamSource):
    """Rays at a scene, for a back end that draws what a viewpoint sees.

    Methods raise an OmnisimError if embreex is not installed, but for `with_intensities`.
    """

    @abstractmethod
    def update(self, scene: Scene) -> None:
        """Replace the static scene."""

    @abstractmethod
    def with_intensities(
        self, beams: LidarBeams, revolution: Revolution, draws: Sequence[PlacedMesh], hits: BeamHits
    ) -> BeamHits:
        """Hits of a revolution, given with their triangles, with the surfaces' intensities.

        Args:
            draws: instances by draw ID − 1; the same object as long as none has changed.
        """

    @abstractmethod
    def camera(self, setup: CameraSetup) -> CameraRays:
        """Rays of a camera's pixels."""


class SceneBackend(BeamSource):
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

    @property
    @abstractmethod
    def rays(self) -> SceneRays:
        """Rays at the scene in its current state."""

    @abstractmethod
    def camera(self, setup: CameraSetup) -> CameraBackend:
        """Camera in the scene.

        Raises:
            OmnisimError: a camera that this back end cannot render, by name.
        """

    @abstractmethod
    def close(self) -> None:
        """Free all memory; a second time does nothing."""


class DeformingDraw(NamedTuple):
    """Instance with a deforming mesh.

    Attributes:
        mesh: mesh and its deformation.
        object_index: index of its dynamic object; None: static.
        object_from_mesh: (4, 4), to the world or the dynamic object's frame.
    """

    mesh: Mesh
    object_index: int | None
    object_from_mesh: Floats


class HitSource(ABC):
    """Casts the rays of a camera's pixels.

    Attributes:
        camera: camera model.
        polygons: number of polygons of the mirror's mesh; None: exact.
        draws: dynamic object and name of each instance, indexed by `Hits.draw_ids` − 1.
        has_ray: (height, width) false outside of the lens or the mirror.
        deforming: instances with deforming meshes, by index.
    """

    camera: CentralCamera
    polygons: int | None
    draws: Sequence[ObjectPart]
    has_ray: Bools
    deforming: Mapping[int, DeformingDraw]

    @abstractmethod
    def rays(self) -> NDArray[np.floating]:
        """Unit rays (height, width, 3), optical frame."""

    @abstractmethod
    def hits(self, poses: ScenePoses, details: HitDetails = NO_DETAILS) -> Hits:
        """Cast all rays."""

    def batch_hits(
        self, poses: Sequence[ScenePoses], details: HitDetails = NO_DETAILS
    ) -> Iterator[Hits]:
        """Cast all rays of each image, in order; by default one after the other."""
        for pose in poses:
            yield self.hits(pose, details)

    @abstractmethod
    def through(self, poses: ScenePoses, hits: Hits) -> ThroughHits:
        """Surfaces behind glass and after mirrors, given the first hits at the same poses.

        Raises:
            OmnisimError: the rays show glass or mirrors, and embreex is not installed.
        """

    @abstractmethod
    def begin_occlusion(
        self, other: ScenePoses, other_from_current: Floats, deformed: Hits | None
    ) -> Pending[Bools]:
        """Begin to find the points of the last `hits` that are occluded from another viewpoint.

        Args:
            other: poses at the other time.
            other_from_current: (draws, 3, 4) transforms of the instances' points, from the
                viewpoint frame of the last hits to that of the other time.
            deformed: last hits with the points of deformed surfaces; None: no surface deforms.

        Returns:
            Mask (height, width).
        """

    def objects_of_draws(self) -> Indices:
        """Object of each instance (n + 1,), after −1 for no hit; 0: the static scene."""
        objects = [0 if index is None else index + 1 for index, _ in self.draws]
        return np.array([0, *objects], dtype=np.intp)
