"""Depth cameras by triangulation: a camera and, beside it, a projector or a second camera.

    disparity = f baseline/z + noise, rounded to its step        z = f baseline/disparity

so that σ_z = σ_disparity z²/(f baseline). A pixel is a hole if its point is hidden from the second
view or out of range, or if the ray grazes the surface.

The second view is to the right, so shadows are on the left of the objects that cast them. Noise is
independent per pixel. Real devices match windows, which makes noise smooth and edges ragged.

Clean panes and mirrors have no pattern of their own. The depth is then that of the surface that the
image shows there: behind a pane, or as far away as in the mirror. If panes and mirrors leave less
than a tenth of the light, twice for a projector's, the pixel is a hole. The model omits dark
surfaces, highlights, sunlight and lens distortion.

Sources: Khoshelham and Elberink, "Accuracy and resolution of Kinect depth data", Sensors 12(2),
2012; Konolige and Mihelich, "Technical description of Kinect calibration", ROS, 2010; Nguyen, Izadi
and Lovell, "Modeling Kinect sensor noise", 3DIMPVT 2012; Grunnet-Jepsen et al., "Tuning depth
cameras for best performance" and "Subpixel linearity improvement", Intel.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.cameras.models.perspective import PerspectiveCamera
from omnisim.core.arrays import Bools, Floats32, Indices
from omnisim.core.files import parameters
from omnisim.core.files.image_files import write_numbers
from omnisim.core.pending import Pending
from omnisim.core.poses import pose
from omnisim.core.random_numbers import key_of, normal, pcg4d
from omnisim.core.short_repr import short_repr
from omnisim.core.world import ObjectPart
from omnisim.rendering.camera.omnicamera import CALIBRATION, OmniCamera
from omnisim.rendering.camera.quality import MAX_IMAGE_PX, scene_size_m
from omnisim.rendering.contract import CameraBackend, CameraSetup, ScenePoses
from omnisim.rendering.instrument import Instrument
from omnisim.rendering.sensor import Moment, Mount, SensorSettings
from omnisim.rendering.shared_scene import SharedScene
from omnisim.rendering.truth import ground_truth_of
from omnisim.sensors.sensor_table import SensorTable

MAX_RANGE_M = 65.535  # 16 bits of millimeters
# A surface casts a shadow if it is nearer to the second view by this share of the depth.
SHADOW_SHARE = 1e-3
# Ratio of neighboring depths at an edge: more than along a surface inclined by 85° to the rays.
EDGE_RATIO = 1.05
# Share of the light that panes and mirrors must leave: an assumption.
MIN_SHARE = 0.1
DEPTH_SUFFIX, STEPS_PER_M = ".png", 1000.0
Size = Annotated[int, Field(strict=True, ge=1, le=MAX_IMAGE_PX)]


@dataclass(frozen=True, kw_only=True, repr=False)
class DepthCamera(parameters.Parameters, SensorSettings, name="depth_camera"):
    """Geometry and errors of a depth camera; the default is a Kinect of the first version."""

    width_px: Size = 640
    """Image width in pixels. Default here and for all further keys: the device's value."""
    height_px: Size = 480
    """Image height in pixels."""
    focal_length_px: parameters.Positive = 580.0
    """Focal length in pixels; the optical axis passes through the image center."""
    baseline_m: parameters.Positive = 0.075
    """Distance in meters to the projector or the second camera, to the right."""
    is_stereo: parameters.Flag = False
    """True: a second camera with the same image size, outside of whose image points are holes;
    false: a projector that lights all of it."""
    range_min_m: parameters.Positive = 0.5
    """Minimum depth along the optical axis in meters; nearer pixels are holes."""
    range_max_m: Annotated[parameters.Number, Field(gt=0.0, le=MAX_RANGE_M)] = 5.0
    """Maximum depth along the optical axis in meters; farther pixels are holes."""
    max_incidence_deg: Annotated[parameters.Number, Field(gt=0.0, le=90.0)] = 80.0
    """Maximum angle between ray and surface normal in degrees; steeper pixels are holes."""
    disparity_sigma_px: parameters.NotNegative = 1.0 / 16.0
    """Standard deviation of the disparity in pixels, including rounding."""
    disparity_step_px: parameters.NotNegative = 1.0 / 8.0
    """Step of the disparity in pixels; 0: no rounding."""
    specular: parameters.Flag = True
    """True: depths are those behind panes and in mirrors, in scenes with such materials; false:
    those of the first surface."""

    noun: ClassVar[str] = "depth"
    origin_noun: ClassVar[str] = "viewpoint"
    suffixes: ClassVar[tuple[str, ...]] = (DEPTH_SUFFIX,)
    document_names: ClassVar[tuple[str, ...]] = (CALIBRATION,)

    def summary(self) -> str:
        """Short description: image size and range."""
        size = f"{self.width_px} × {self.height_px} px"
        return f"{size}, {self.range_min_m:.3g} to {self.range_max_m:g} m"

    def open(self, stage: SharedScene, mount: Mount[object]) -> DepthRenderer:
        """Open a renderer of depth images on a stage."""
        return DepthRenderer(stage, self, mount)

    @property
    def near_m(self) -> float:
        """Minimum distance of visible surfaces."""
        return OmniCamera(self.model).near_m

    def documents(self, mount: Mount[object]) -> dict[str, str]:
        """Text of the calibration file, by file name."""
        camera = OmniCamera(self.model, base_from_rig=mount.base_from_sensor)
        return {CALIBRATION: camera.calibration_json()}

    def _check(self) -> None:
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")
        if self.second_width_px > MAX_IMAGE_PX:
            raise self._error("baseline_m", "a smaller one, for a narrower second view")

    @classmethod
    def kinect_v1(cls) -> DepthCamera:
        """Microsoft's Kinect of 2010, with structured light.

        The focal length of 580 px, the baseline of 75 mm and the step of 1/8 px are from Konolige
        and Mihelich. A sigma of half a step and the range of 0.5 to 5 m are from Khoshelham and
        Elberink; their σ_z = 1.425e-3 z² agrees to 1 %. The limit of 80° is an assumption, based on
        the angles at which Nguyen et al. measure depth.
        """
        return cls()

    @classmethod
    def d435(cls) -> DepthCamera:
        """Intel's RealSense D435 at 848 × 480: stereo with a projected texture.

        The 90° field of view, the baseline of 50 mm, the noise of 0.08 px and the steps of 1/32 px
        are Intel's, and so is the range of 10 m. The minimum depth follows from the maximum
        disparity of 126 px. The limit of 85° is an assumption.
        """
        focal_length_px, baseline_m = 424.0, 0.05
        return cls(
            width_px=848,
            height_px=480,
            focal_length_px=focal_length_px,
            baseline_m=baseline_m,
            is_stereo=True,
            range_min_m=focal_length_px * baseline_m / 126.0,
            range_max_m=10.0,
            max_incidence_deg=85.0,
            disparity_sigma_px=0.08,
            disparity_step_px=1.0 / 32.0,
        )

    def without_noise(self) -> DepthCamera:
        """Copy of the camera with exact depths; holes remain."""
        return dataclasses.replace(self, disparity_sigma_px=0.0, disparity_step_px=0.0)

    @property
    def model(self) -> PerspectiveCamera:
        """Camera model."""
        middle = (0.5 * (self.width_px - 1), 0.5 * (self.height_px - 1))
        return PerspectiveCamera(self.width_px, self.height_px, self.focal_length_px, middle)

    @property
    def second_model(self) -> PerspectiveCamera:
        """Camera model of the second view; a projector's is wide enough for all points in range."""
        u, v = self.model.principal_point_px
        return PerspectiveCamera(
            self.second_width_px, self.height_px, self.focal_length_px, (u + self._margin_px, v)
        )

    @property
    def second_width_px(self) -> int:
        """Width of the second view, px."""
        return self.width_px + self._margin_px

    @property
    def _margin_px(self) -> int:
        """Number of columns that the second view extends beyond the camera's left edge."""
        return 0 if self.is_stereo else math.ceil(self._disparity_m / self.range_min_m)

    @property
    def _disparity_m(self) -> float:
        """Product of disparity and depth, in pixels times meters."""
        return self.focal_length_px * self.baseline_m

    def sigma_m(self, z_m: float) -> float:
        """Standard deviation of a depth measurement at depth `z_m`."""
        return self.disparity_sigma_px * z_m**2 / self._disparity_m

    def measure(
        self,
        z_m: Floats32,
        second_z_m: Floats32,
        incidence_cosines: Floats32,
        seed: int | str = 0,
        frame_number: int = 0,
    ) -> Floats32:
        """Simulate depths (height, width) along the optical axis in meters; 0 in holes.

        Args:
            z_m: (height, width) true depths; +inf: no surface.
            second_z_m: (height, second_width_px) true depths of the second view.
            incidence_cosines: (height, width) cosines between normals and rays.
            seed: seed of the noise.
            frame_number: index of the frame; each frame has its own noise.
        """
        measured = self._with_noise(z_m, seed, frame_number)
        is_steep = incidence_cosines < math.cos(math.radians(self.max_incidence_deg))
        with np.errstate(invalid="ignore"):  # infinite depths
            is_out = ~((measured >= self.range_min_m) & (measured <= self.range_max_m))
        holes = is_steep | is_out | ~np.isfinite(z_m)
        seen = np.nonzero(~holes)
        holes[seen] = ~self._is_seen_twice(z_m[seen], second_z_m, *seen)
        return np.where(holes, np.float32(0.0), measured)

    def _with_noise(self, z_m: Floats32, seed: int | str, frame_number: int) -> Floats32:
        """Depths (height, width) from noisy disparities; +inf if a disparity is not positive."""
        sigma_px, step_px = self.disparity_sigma_px, self.disparity_step_px
        if not sigma_px and not step_px:
            return z_m
        rows, columns = np.indices(z_m.shape)
        hashes = pcg4d(columns, rows, frame_number, key_of("depth", seed))
        # rounding contributes uniformly distributed noise
        white_px = math.sqrt(max(sigma_px**2 - step_px**2 / 12.0, 0.0))
        disparity_px = self._disparity_m / z_m + white_px * normal(hashes[0], hashes[1])
        if step_px:
            disparity_px = step_px * np.round(disparity_px / step_px)
        measured = np.full(z_m.shape, np.inf, np.float32)
        np.divide(self._disparity_m, disparity_px, out=measured, where=disparity_px > 0.0)
        return measured

    def _is_seen_twice(
        self, z_m: Floats32, second_z_m: Floats32, rows: Indices, columns: Indices
    ) -> Bools:
        """Mask (n,) of the points, given by depth and pixel, that the second view sees."""
        second_u = columns + self._margin_px - self._disparity_m / z_m.astype(np.float64)
        left = np.clip(np.floor(second_u).astype(np.intp), 0, self.second_width_px - 2)
        beside = second_z_m[rows, left], second_z_m[rows, left + 1]
        farther = np.maximum(*beside)
        is_edge = farther > EDGE_RATIO * np.minimum(*beside)
        nearest = np.where(second_u - left < 0.5, *beside) * math.sqrt(EDGE_RATIO)
        # on a smooth surface the point's depth lies between those of two neighboring pixels
        limit_m = np.where(is_edge, nearest, farther * (1.0 + SHADOW_SHARE))
        in_image = (second_u >= -0.5) & (second_u <= self.second_width_px - 0.5)
        return in_image & (z_m <= limit_m)


class _Views:
    """Render passes of the camera and of the second view."""

    def __init__(self, backends: Iterable[CameraBackend]):
        self.first, self.second = backends

    def refresh(self) -> None:
        """Refresh both back ends after a change of the stage."""
        self.first.refresh()
        self.second.refresh()


@dataclass(frozen=True, eq=False)
class DepthImage:
    """Image of a depth camera.

    Attributes:
        depths_m: (height, width) depths along the optical axis in meters; 0 in holes.
        metadata: omnisim's version, the scene and the image's number.
    """

    depths_m: Floats32
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        height, width = self.depths_m.shape
        return short_repr(self, f"{width} × {height} px")

    @property
    def depths_mm(self) -> NDArray[np.uint16]:
        """Depths (height, width) in whole millimeters; 0 in holes. Source: ROS, REP 118."""
        return np.round(self.depths_m * STEPS_PER_M).astype(np.uint16)

    def save(self, stem: Path) -> None:
        """Write depths as a PNG of 16-bit millimeters, 0 in holes.

        Raises:
            OutputError: the file cannot be written.
        """
        unit = {"unit_m": 1.0 / STEPS_PER_M}
        write_numbers(stem.with_suffix(DEPTH_SUFFIX), self.depths_mm, unit)


class DepthRenderer(Instrument[DepthCamera, _Views, DepthImage]):
    """Renders a depth camera's images of a scene."""

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> _Views:
        stage, camera, mount = self._stage, self.sensor, self.mount.base_from_sensor
        # to the right as seen along x
        beside = mount @ pose((0.0, -camera.baseline_m, 0.0))
        size_m, vehicles = scene_size_m(stage.scene), tuple(stage.vehicles)
        cameras = (
            OmniCamera(camera.model, base_from_rig=mount).seeing(size_m),
            OmniCamera(camera.second_model, base_from_rig=beside).seeing(size_m),
        )
        setups = (CameraSetup(sensor, True, hidden, 0, vehicles) for sensor in cameras)
        return _Views(stage.backend.camera(setup) for setup in setups)

    def begin(self, moment: Moment) -> Pending[DepthImage]:
        """Render the depths at a moment, with an instantaneous shutter."""
        now = self._state(moment.motion(moment.time_s))
        world_from_base, sensor = now.world_from_object[self.vehicle], self.sensor
        objects = self._stage.poses_in(now)
        with self._current() as views:
            through = sensor.specular and self._stage.backend.follows_specular()
            (z_m, cosines, shares), (second_z_m, *_) = (
                _depths(
                    view,
                    ScenePoses(world_from_base @ view.setup.sensor.base_from_rig, objects),
                    view is views.first,
                    through,
                )
                for view in (views.first, views.second)
            )
        assert cosines is not None
        if shares is not None:
            left = shares if sensor.is_stereo else shares**2
            z_m = np.where(left >= MIN_SHARE, z_m, np.float32(np.inf))
        seed, number = self.mount.seed, moment.number
        depths_m = sensor.measure(z_m, second_z_m, cosines, seed, number)
        return Pending.done(DepthImage(depths_m, self._metadata(number=int(number))))


def _depths(
    view: CameraBackend, poses: ScenePoses, has_cosines: bool, through: bool
) -> tuple[Floats32, Floats32 | None, Floats32 | None]:
    """Depths of a view at the poses, of the first surfaces or through glass and by mirrors.

    Returns:
        Arrays (height, width): depths along the optical axis, +inf without a surface; if wanted,
        cosines between normals and rays; and, if through glass, shares of light left one way.
    """
    names = ("range", "z") if through else ("z",)
    names = (*names, "normals_camera") if has_cosines else names
    truth, model = ground_truth_of(view, names), view.setup.sensor.model
    seen = None
    if through:
        channels, seen = truth.channels_through(names, poses)
    else:
        channels = truth.channels(names, poses)
    z_m, cosines = channels["z"], None
    if has_cosines:
        u, v = np.meshgrid(np.arange(model.width_px), np.arange(model.height_px))
        rays = model.ray_from_pixel(np.stack((u, v), axis=-1)).directions.astype(np.float32)
        cosines = np.abs(np.einsum("hwc,hwc->hw", channels["normals_camera"], rays))
    if seen is None:
        return z_m, cosines, None
    # along the ray of a pixel, depth grows with the path behind glass and by mirrors
    followed = np.isfinite(seen.cosines) | np.isinf(seen.ranges_m)
    followed &= np.isfinite(channels["range"])
    z_m[followed] *= seen.ranges_m[followed] / channels["range"][followed]
    if cosines is not None:
        cosines = np.where(np.isfinite(seen.cosines), seen.cosines, cosines)
    return z_m, cosines, seen.shares


DEVICES = {"kinect_v1": DepthCamera.kinect_v1, "d435": DepthCamera.d435}


@parameters.overriding(DepthCamera)
class DepthCameraTable(SensorTable):
    """Depth camera, looking along x; the drive's seed determines its errors."""

    sensor_class: ClassVar[type[SensorSettings]] = DepthCamera

    type: Literal["depth_camera"]
    device: Literal["kinect_v1", "d435"] = "kinect_v1"
    """Device that sets size, field of view, range and errors: "kinect_v1" or Intel's "d435"."""
    noise: parameters.Flag = True
    """True: the device's errors; false: depths exact to the millimeter, with holes."""

    def sensor(self) -> DepthCamera:
        """Build the camera's settings."""
        camera = self.overriding(DEVICES[self.device]())
        return camera if self.noise else camera.without_noise()
