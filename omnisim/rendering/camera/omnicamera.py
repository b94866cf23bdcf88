"""Camera sensors: camera model, virtual cameras, mounting and degradation."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera, summary
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.mirror_mesh import sectors_and_rings
from omnisim.core import poses
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError, RunError
from omnisim.core.extras import missing_packages
from omnisim.core.files.parameters import NOT_IN_FILES
from omnisim.core.short_repr import short_repr
from omnisim.rendering.camera.degradations import Degradation
from omnisim.rendering.camera.quality import (
    DEFAULT_NEAR_M,
    MAX_ERROR_PX,
    MAX_IMAGE_PX,
    Capture,
    CaptureQuality,
    QualityName,
    auto_polygons,
    max_polygons,
    mesh_error_px,
    near_plane_m,
    quality_named,
)
from omnisim.rendering.sensor import Mount, SensorSettings

if TYPE_CHECKING:
    from omnisim.cameras.calibration import CalibratedCamera, Calibration
    from omnisim.core.trajectories import Trajectory

# Inputs from which `OmniCamera.of` makes a sensor; None: the paper's.
CameraLike: TypeAlias = (
    "OmniCamera | CentralCamera | Calibration | CalibratedCamera | str | Path | None"
)
Polygons = int | Literal["auto", "default"] | None  # polygons of a mirror mesh; None: exact
ExposureOption = float | Literal["auto"]  # fixed exposure, EV, or automatic
RendererT_co = TypeVar("RendererT_co", covariant=True)
# Files of a step, and of a run.
IMAGE_SUFFIX, CHANNELS_SUFFIX, DESCRIPTION_SUFFIX = ".png", ".channels.exr", ".channels.json"
BOXES_SUFFIX, BOXES_3D_SUFFIX = ".coco.json", ".boxes_3d.json"
SENSOR_FILE, CALIBRATION = "sensor.toml", "calibration.json"
CAMERA_POSES = "poses.tum"  # poses of a rig's camera
VIEWPOINT_GRID = 33  # maximum number of rays per image side that define the viewpoint
PAPER_POLYGONS = 1024
PAPER_SIZE_PX = 360


class CameraStage(Protocol[RendererT_co]):
    """Stage that opens cameras."""

    def open_camera(self, camera: OmniCamera, mount: Mount[object]) -> RendererT_co:
        """Open a camera at a mount."""


@dataclass(frozen=True, eq=False)
class OmniCamera(Capture, SensorSettings):
    """An omnidirectional camera: a pinhole camera below a mirror, or a lens.

    Without arguments: the paper's camera.

    Attributes:
        model: camera model, including its mirror if it has one.
        polygons: polygons of the mirror mesh. "auto": the fewest that keep the largest error in the
            image below a tenth of a pixel, see `mesh_polygons`. None: exact capture, pixel by
            pixel; a lens is always exact. "default": None for an optical system, whose exact rays
            are traced once; "auto" for other cameras.
        base_from_rig: (4, 4) pose of the sensor on its vehicle; its origin is the effective
            viewpoint.
        face_size_px: texels across the 90° of each virtual camera; None: as the image requires.
        near_m, far_m, samples, mirrors, reflection_probes, supersampling, texels_per_pixel: see
            `Capture`. The default near plane is nearer in small scenes, see `seeing`.
        degradation: degradation of the ideal image; by default none.

    Raises:
        OmnisimError: no camera model, a polygon count that makes no mesh, an empty range between
            near and far, an invalid size or number of samples, or an invalid mounting pose.
    """

    model: CentralCamera = field(
        default_factory=lambda: HyperbolicCamera.framed_on_rim(
            HyperbolicMirror(), PAPER_SIZE_PX, PAPER_SIZE_PX
        ),
        metadata=NOT_IN_FILES,
    )
    _: KW_ONLY
    polygons: Polygons = field(default="default", metadata=NOT_IN_FILES)
    base_from_rig: Floats = field(default_factory=lambda: np.eye(4), metadata=NOT_IN_FILES)
    face_size_px: int | None = field(default=None, metadata=NOT_IN_FILES)
    degradation: Degradation = field(default_factory=Degradation, metadata=NOT_IN_FILES)

    noun: ClassVar[str] = "camera"
    origin_noun: ClassVar[str] = "effective viewpoint"
    suffixes: ClassVar[tuple[str, ...]] = (
        IMAGE_SUFFIX,
        CHANNELS_SUFFIX,
        DESCRIPTION_SUFFIX,
        ".*.npy",
        BOXES_SUFFIX,
        BOXES_3D_SUFFIX,
    )
    document_names: ClassVar[tuple[str, ...]] = (SENSOR_FILE, CALIBRATION, CAMERA_POSES)
    has_ground_truth: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not isinstance(self.model, CentralCamera):
            raise OpticsError(f"camera: expected a camera model, got {type(self.model).__name__}")
        if self.polygons == "default":
            polygons = None if isinstance(self.model, NonCentralCamera) else "auto"
            object.__setattr__(self, "polygons", polygons)  # frozen
        if self.polygons is not None and self.polygons != "auto":
            if type(self.polygons) is not int:
                expected = "expected a whole number, 'auto' or None"
                raise OpticsError(f"polygons: {expected}, got {self.polygons!r}")
            sectors_and_rings(self.polygons)
            if max_polygons(self.model) is None:
                raise OpticsError(
                    f"polygons = {self.polygons}: a camera of model {self.model.model_name!r} has "
                    "no mirror with a mesh: expected 'auto' or 'exact'"
                )
        if self.face_size_px is not None and self.face_size_px < 1:
            expected = "expected at least 1, or None"
            raise OpticsError(f"face_size_px: {expected}, got {self.face_size_px}")
        poses.check_pose(self.base_from_rig)
        super().__post_init__()  # checks the settings of `Capture`

    def __repr__(self) -> str:
        return short_repr(
            self,
            self.summary(),
            self.mesh_summary,
            "" if self.degradation.is_ideal else f"degraded by {', '.join(self.degradation.parts)}",
        )

    @classmethod
    def of(cls, camera: CameraLike) -> OmniCamera:
        """Sensor from any description of a camera.

        Args:
            camera: a sensor; a camera model; path of a sensor, optics or single-camera calibration
                file; `catalog:` and a name, see `omnisim.cameras.catalog`; a single-camera
                calibration, or one of its cameras; None: the paper's.

        Raises:
            SensorFileError: names file, key, value and the expected value.
            CalibrationError: the same for calibration files, or several cameras.
            OpticsError: the input is none of these.
        """
        if isinstance(camera, OmniCamera):
            return camera
        if camera is None:
            return cls()
        if isinstance(camera, CentralCamera):
            return cls(camera)
        if isinstance(camera, str | Path) and str(camera).startswith("catalog:"):
            return cls.of_catalog(str(camera))
        if isinstance(camera, str | Path) and Path(camera).suffix.lower() in ("", ".toml"):
            return cls.from_file(camera)
        # imported late: only users of calibrations need formats and fits
        from omnisim.cameras.calibration import CalibratedCamera, Calibration, load_calibration

        source = load_calibration(camera) if isinstance(camera, str | Path) else camera
        if isinstance(source, Calibration):
            source = source.only_camera()
        if isinstance(source, CalibratedCamera):
            return cls(source.camera, polygons=None)
        return cls(source)

    @classmethod
    def of_catalog(cls, name: str) -> OmniCamera:
        """Camera of the catalog by its name, with its measured rolling shutter.

        Raises:
            CalibrationError: no such camera, or several.
        """
        from omnisim.cameras.catalog.lens_catalog import find  # reads all of them
        from omnisim.rendering.camera.degradations import Degradation
        from omnisim.rendering.camera.degradations.shutter import Shutter

        entry = find(name)
        shutter = Shutter(readout_s=entry.readout_s) if entry.readout_s else None
        return cls(entry.lens, degradation=Degradation(shutter=shutter), polygons=None)

    @classmethod
    def from_file(cls, path: str | Path) -> OmniCamera:
        """Read a sensor file.

        Raises:
            SensorFileError: names file, key, value and the expected value.
        """
        # the paper's camera needs none
        from omnisim.rendering.camera.sensor_file import read_sensor_file

        return cls(**read_sensor_file(Path(path)))

    @classmethod
    def from_table(cls, table: dict[str, Any], source: str = "sensor") -> OmniCamera:
        """Make a sensor from a table with the keys of a sensor file.

        Raises:
            SensorFileError: names `source`, key, value and the expected value.
        """
        from omnisim.rendering.camera.sensor_file import parse_sensor

        return cls(**parse_sensor(table, source))

    def resized(self, size_px: int) -> OmniCamera:
        """The same view in an image whose shorter side has `size_px` pixels.

        Raises:
            OpticsError: the size is below 1, or beyond the limit of GPUs.
        """
        if not 1 <= size_px <= MAX_IMAGE_PX:
            raise OpticsError(f"camera: size: expected 1 to {MAX_IMAGE_PX}, got {size_px}")
        scale = size_px / min(self.model.width_px, self.model.height_px)
        model, degradation = self.model.scaled(scale), self.degradation.scaled(scale)
        return dataclasses.replace(self, model=model, degradation=degradation)

    def summary(self) -> str:
        """Camera model and image size as text."""
        return summary(self.model)

    def mounted(self, base_from_mount: ArrayLike | None) -> OmniCamera:
        """The same sensor on a mount at a pose (4, 4) on the vehicle; None: at its base.

        Raises:
            OmnisimError: an invalid pose.
        """
        if base_from_mount is None or np.array_equal(base_from_mount, np.eye(4)):
            return self
        base_from_rig = poses.check_pose(base_from_mount) @ self.base_from_rig
        return dataclasses.replace(self, base_from_rig=base_from_rig)

    def seeing(self, size_m: float) -> OmniCamera:
        """The same camera for a scene of a given size, to which a default near plane adapts.

        Rays that start beside the effective viewpoint need a near plane beyond their origins, so
        non-central optics keep theirs.
        """
        near_m = near_plane_m(size_m, DEFAULT_NEAR_M)
        is_kept = self.near_m != DEFAULT_NEAR_M or isinstance(self.model, NonCentralCamera)
        is_kept |= near_m == DEFAULT_NEAR_M
        return self if is_kept else dataclasses.replace(self, near_m=near_m)

    @cached_property
    def mesh_polygons(self) -> int | None:
        """Polygons of the mirror mesh: `polygons`, or the result of "auto"; None: exact.

        "auto" is exact if even the finest mesh has a larger error.
        """
        return auto_polygons(self.model) if isinstance(self.polygons, str) else self.polygons

    @property
    def mesh_error_px(self) -> float:
        """Largest error of the mirror mesh in the image; 0 if exact."""
        return mesh_error_px(self.model, self.mesh_polygons)

    @property
    def mesh_summary(self) -> str:
        """Polygons of the mirror mesh as text."""
        if self.mesh_polygons is not None:
            chosen = " (auto)" if self.polygons == "auto" else ""
            return f"{self.mesh_polygons} polygons{chosen}"
        most = None if self.polygons is None else max_polygons(self.model)
        if most is None:
            return "exact"
        return f"exact (auto: {MAX_ERROR_PX} px need more than {most} polygons)"

    @property
    def supersampled_model(self) -> CentralCamera:
        """Model of the supersampled image, which is averaged to this one."""
        return self.model.scaled(self.supersampling)

    @property
    def base_from_optical(self) -> Floats:
        """Pose (4, 4) of the camera's optical frame on its vehicle."""
        pose = self.base_from_rig.copy()
        pose[:3, :3] = pose[:3, :3] @ self.model.rig_from_optical
        return pose

    def with_polygons(self, polygons: Polygons) -> OmniCamera:
        """The same sensor with another mesh, see `polygons`.

        Raises:
            OpticsError: the polygon count does not make a mesh.
        """
        return dataclasses.replace(self, polygons=polygons)

    def with_quality(self, name: QualityName | str) -> OmniCamera:
        """The same sensor with a capture quality by name: "fast", "default" or "fine".

        Raises:
            OpticsError: the name is unknown.
        """
        return dataclasses.replace(self, **quality_named(name)._asdict())

    def with_degradation(self, degradation: Degradation) -> OmniCamera:
        """The same sensor with another degradation."""
        return dataclasses.replace(self, degradation=degradation)

    def with_exposure(self, exposure: ExposureOption) -> OmniCamera:
        """The same sensor with a fixed exposure, EV, or with automatic exposure.

        A table of automatic exposure that the camera has keeps its other values.

        Raises:
            SensorFileError: an exposure out of range.
        """
        from omnisim.rendering.camera.degradations import Exposure  # an ideal camera has none

        changed = self.degradation.exposure or Exposure()
        if exposure != "auto":
            changed = dataclasses.replace(changed, ev=exposure, auto=False)
        elif not changed.auto:
            changed = dataclasses.replace(changed, ev=0.0, auto=True)
        return self.with_degradation(dataclasses.replace(self.degradation, exposure=changed))

    def base_pose(
        self,
        viewpoint_m: ArrayLike,
        *,
        yaw_deg: float = 0.0,
        pitch_deg: float = 0.0,
        roll_deg: float = 0.0,
    ) -> Floats:
        """Pose (4, 4) world_from_base that puts the effective viewpoint at a position.

        Args:
            viewpoint_m: (3,) position in the world.
            yaw_deg, pitch_deg, roll_deg: attitude of the vehicle, by default level.

        Raises:
            OmnisimError: a position or angle is not finite.
        """
        world_from_base = poses.pose(
            viewpoint_m, roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg
        )
        world_from_base[:3, 3] -= world_from_base[:3, :3] @ self.base_from_rig[:3, 3]
        return world_from_base

    def to_toml(self) -> str:
        """Sensor file with every key, mounting included."""
        from omnisim.core.files.toml_file import toml_text  # few cameras are written

        angles = np.degrees(poses.roll_pitch_yaw_from_rotation(self.base_from_rig[:3, :3]))
        # 1e-12°: hides the rounding of the conversion through radians
        roll, pitch, yaw = (round(float(angle), 12) + 0.0 for angle in angles)
        polygons = "exact" if self.polygons is None else self.polygons
        model, image = self.model, dict[str, Any]()
        if isinstance(model, HyperbolicCamera):
            group, geometry = "mirror", {"shape": "hyperbolic", **model.mirror.to_table(full=True)}
            geometry["theta_max_deg"] = round(geometry["theta_max_deg"], 12)
            geometry["polygons"] = polygons
            keys = ("width_px", "height_px", "focal_length_px", "principal_point_px")
            image = {key: getattr(model, key) for key in keys}
        elif isinstance(model, NonCentralCamera):
            group, geometry = "optics", {**model.parameters(), "polygons": polygons}
            geometry.pop("model", None)
        else:
            group, geometry = "lens", dict(model.parameters())
        mounting = {
            "position_m": self.base_from_rig[:3, 3].tolist(),
            "roll_deg": roll,
            "pitch_deg": pitch,
            "yaw_deg": yaw,
        }
        virtual: dict[str, Any] = {"size_px": self.face_size_px or "auto"}
        written, changed = self.to_table(full=True), self.to_table()
        virtual |= {key: written[key] for key in ("texels_per_pixel", "near_m", "far_m", "samples")}
        virtual |= {key: changed.get(key) for key in ("mirrors", "reflection_probes")}
        return toml_text(
            {
                group: {"mounting": mounting, **geometry},
                "virtual_cameras": virtual,
                "camera": {**image, "supersampling": self.supersampling},
                "degradation": self.degradation.tables() or None,
            }
        )

    def calibration_json(self) -> str:
        """Calibration file of the camera in a run."""
        content = {
            "camera": self.model.parameters(),
            "polygons": self.mesh_polygons or "exact",
            "base_from_optical": self.base_from_optical.tolist(),
        }
        return json.dumps(content, indent=2) + "\n"

    def open(self, stage: CameraStage[RendererT_co], mount: Mount[object]) -> RendererT_co:
        """Open a renderer on a stage."""
        return stage.open_camera(self, mount)

    def origin_m(self, base_from_sensor: Floats) -> Floats:
        """Effective viewpoint (3,), base; for non-central optics, the point nearest the rays."""
        base_from_optical = base_from_sensor @ self.base_from_optical
        if not isinstance(self.model, NonCentralCamera):
            return base_from_optical[:3, 3]
        from omnisim.cameras.optics.centrality import common_point  # needed by few cameras

        sizes = self.model.width_px, self.model.height_px
        u, v = (np.linspace(0.0, size - 1.0, min(size, VIEWPOINT_GRID)) for size in sizes)
        rays = self.model.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
        if rays.origins_m is None or not rays.valid.any():
            return base_from_optical[:3, 3]
        nearest_m = common_point(rays.origins_m[rays.valid], rays.directions[rays.valid])
        nearest_from_origin_m: Floats = base_from_optical[:3, :3] @ nearest_m
        return nearest_from_origin_m + base_from_optical[:3, 3]

    @classmethod
    def suffixes_of(cls, manifest: Mapping[str, Any]) -> tuple[str, ...]:
        """Suffixes of an image, its channels, and its instances' bounding boxes."""
        suffixes, channels = [IMAGE_SUFFIX], manifest["channels"]
        if channels and manifest["channel_format"] != "npy":
            suffixes.append(CHANNELS_SUFFIX)
        if channels and manifest["channel_format"] != "auto":
            suffixes += [*(f".{name}.npy" for name in channels), DESCRIPTION_SUFFIX]
        if "instance" in channels:
            suffixes.append(BOXES_SUFFIX)
        if manifest["boxes_3d"]:
            suffixes.append(BOXES_3D_SUFFIX)
        return tuple(suffixes)

    def manifest(self, mount: Mount[object]) -> dict[str, Any]:
        """Settings of degradation and quality, and all parameters of an optical system.

        Files of optics may change, and whether unreliable samples are cast depends on packages.
        """
        settings: dict[str, Any] = {}
        if isinstance(self.model, NonCentralCamera):
            casts_rays = not missing_packages("rays")
            settings = {"optics": self.model.parameters(), "casts_rays": casts_rays}
        if mount.time_shift_s:
            settings["time_shift_s"] = mount.time_shift_s
        quality = {key: getattr(self, key) for key in CaptureQuality._fields}
        return {**settings, "degradation": self.degradation.tables(), "quality": quality}

    def documents(self, mount: Mount[object]) -> dict[str, str]:
        """Texts of the sensor file and the calibration file, by file name."""
        return {SENSOR_FILE: self.to_toml(), CALIBRATION: self.calibration_json()}

    def check_trajectory(self, mount: Mount[object], truth: Trajectory, times_s: Floats) -> None:
        """Raise an error if an exposure lasts longer than the time to the next image.

        Raises:
            RunError: an exposure is too long; names camera, step, exposure and limit.
        """
        exposure_s = self.degradation.exposure_s
        periods_s = np.diff(times_s)
        if np.any(periods_s < exposure_s):
            step = int(np.argmin(periods_s))
            what = "step" if mount.rate is None else "image"
            raise RunError(
                f"camera {mount.name!r}: degradation.shutter.exposure_s: expected at most "
                f"{periods_s[step]:g} s, the time from {what} {step} to {step + 1}, "
                f"got {exposure_s:g}"
            )
