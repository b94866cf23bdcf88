"""Plans with their files: scenes with their free floor, rigs, objects, poses."""

from __future__ import annotations

import fnmatch
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import PlanError, did_you_mean
from omnisim.core.extras import require_extra
from omnisim.core.files.sources import SourceReader, fingerprint
from omnisim.core.trajectories import parse_trajectory
from omnisim.core.version import __version__
from omnisim.datasets.free_space import (
    FreeSpace,
    find_free_space,
    free_space_path,
    read_free_space,
    write_free_space,
)
from omnisim.datasets.generate.distributions import ConstantShares
from omnisim.datasets.generate.plan import Plan, PlanObjectTable, PlanSceneTable, read_plan
from omnisim.datasets.generate.plan_cameras import PlanRig, RigFile, draw_light
from omnisim.ground_truth.channels import CLASSES
from omnisim.scene import Scene, read_scene
from omnisim.scene.labels import find_labels, read_label_file

# Shares of the distributions at which a plan's setups are checked in advance.
TRIED = 0.001, 0.5, 0.999


@dataclass(frozen=True, eq=False)
class PlanObject:
    """Object to place."""

    title: str  # name of its instances
    scene: Scene  # shape of the object
    low_m: Floats  # (3,) lowest coordinates of its bounds
    radius_m: float  # radius of its footprint about the middle of its bounds
    middle_m: Floats  # (2,) middle of its bounds on the floor plan
    height_m: float  # height of its bounds


class PreparedPlan:
    """Plan with its files; each file is read once, when it is first needed.

    Files of free floors are in the folder of the data set; None: there are none.
    """

    def __init__(self, plan: Plan, path: Path, folder: Path | None = None):
        self.plan, self.path, self._folder = plan, path, folder
        self._scenes: dict[int, Scene] = {}
        self._free: dict[int, FreeSpace] = {}

    @classmethod
    def read(cls, path: Path, folder: Path | None = None) -> PreparedPlan:
        """Read a plan.

        Raises:
            PlanError: one line per fault.
            OmnisimError: packages that a key needs are not installed.
        """
        plan = read_plan(path)
        if plan.min_visible is not None:
            require_extra("rays", f"{path}: min_visible")
        return cls(plan, path, folder)

    def check(self) -> None:
        """Read all files, and check the free floors, paths and objects that viewpoints need.

        Raises:
            OmnisimError: the first fault.
        """
        _ = self.rigs, self.objects, self.poses
        self.check_setups()
        for number in range(len(self.plan.scenes)):
            self.scene(number)
            self.find_free_space(number)
            if self.plan.viewpoints.where == "path":
                self.paths(number)
            if self.plan.viewpoints.where == "around":
                self.middles(number)
            for table in self.plan.vary.recolor:
                self.instances(number, table.nodes, "vary.recolor.nodes")

    def notices(self) -> list[str]:
        """Notices of the scenes, and of classes whose IDs differ between scenes."""
        notices = []
        numbers: dict[str, int] = {}
        for index in range(len(self.plan.scenes)):
            scene = self.scene(index)
            notices += [f"{scene.name}: {notice}" for notice in scene.notices]
            if not set(CLASSES).isdisjoint(self.plan.channels):
                for label in find_labels(scene).classes:
                    if numbers.setdefault(label.name, label.id) != label.id:
                        notices.append(
                            f"{scene.name}: class {label.name!r} is {label.id} here and "
                            f"{numbers[label.name]} in another scene: give all scenes the same "
                            "labels = FILE for one number"
                        )
                        break
        return notices

    def scene(self, number: int) -> Scene:
        """Scene of the plan, with its labels."""
        if number not in self._scenes:
            table = self.plan.scenes[number]
            source = self._scene_file(table)
            scene = read_scene(source, table.up_axis, table.meters_per_unit)
            scene = scene.altered(name=table.title)  # its own would be the plan's path
            if table.labels is not None:
                rules = read_label_file(self.path.parent / table.labels)
                scene = scene.altered(f"labels {rules}", labels=rules)
            self._scenes[number] = scene
        return self._scenes[number]

    def _scene_file(self, table: PlanSceneTable | PlanObjectTable) -> str | Path:
        """Path of a scene file beside the plan; if there is none, the name as in the plan."""
        beside = self.path.parent / table.file
        return beside if beside.exists() else table.file

    def find_free_space(self, number: int) -> None:
        """Find the free floor of a scene, if viewpoints or objects need it.

        Raises:
            OmnisimError: there is no free floor.
        """
        if self.plan.viewpoints.where != "poses" or self.objects:
            self.free_space(number)

    def free_space(self, number: int) -> FreeSpace:
        """Free floor of a scene.

        Raises:
            OmnisimError: there is no free floor.
        """
        if number not in self._free:
            file = None
            if self._folder is not None:
                file = free_space_path(self._folder, self.fingerprint, number)
            free = None if file is None else read_free_space(file)
            if free is None:
                table = self.plan.viewpoints
                highest_m = table.height_m.high
                tallest = max((moving.height_m for moving in self.objects), default=0.0)
                free = find_free_space(
                    self.scene(number),
                    table.radius_m,
                    max(highest_m if np.isfinite(highest_m) else 2.0, min(tallest, 2.0)),
                    table.step_m,
                    self.plan.scenes[number].floor_m,
                    # along paths and around objects, the floor is needed everywhere
                    table.where == "free" and table.region == "start",
                )
                if file is not None:
                    write_free_space(file, free)
            self._free[number] = free
        return self._free[number]

    def paths(self, number: int) -> tuple[Floats, ...]:
        """Waypoints (n, 2) in meters of each path of a scene that has viewpoints.

        Raises:
            PlanError: the scene lacks a path.
        """
        scene, names = self.scene(number), self.plan.viewpoints.paths
        known = {path.name: np.array(path.waypoints_m) for path in scene.paths}
        for name in names:
            if name not in known:
                raise PlanError(
                    f"{self.path}: viewpoints.paths: {name!r} in {scene.name}: "
                    f"{did_you_mean(name, known, 'its paths are')}"
                )
        paths = tuple(known[name] for name in names or known)
        if not paths:
            raise PlanError(f"{self.path}: viewpoints.where: {scene.name} has no paths")
        return paths

    def middles(self, number: int) -> tuple[Floats, ...]:
        """Centers (3,) of the bounding boxes of objects that viewpoints surround."""
        scene = self.scene(number)
        names = self.instances(number, self.plan.viewpoints.nodes, "viewpoints.nodes")
        boxes = [scene.instance_boxes[name] for name in names if name in scene.instance_boxes]
        return tuple(np.asarray(box.center_m, dtype=np.float64) for box in boxes)

    def instances(self, number: int, patterns: Sequence[str], key: str) -> tuple[str, ...]:
        """Names of a scene's instances that match patterns.

        Raises:
            PlanError: no instance matches.
        """
        scene = self.scene(number)
        names = tuple(
            name
            for name in scene.instance_names
            if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)
        )
        if not names:
            raise PlanError(
                f"{self.path}: {key} = {list(patterns)}: no such object in {scene.name}; "
                "`omnisim scene` lists them"
            )
        return names

    @cached_property
    def rig_files(self) -> tuple[RigFile, ...]:
        """Cameras of each [[cameras]] table, from their files."""
        is_exposed = "exposure_ev" in self.plan.vary.model_fields_set
        return tuple(RigFile(table, self.path, is_exposed) for table in self.plan.cameras)

    @cached_property
    def rigs(self) -> tuple[PlanRig, ...]:
        """Cameras and rigs of the plan, before anything varies."""
        return tuple(file.rig() for file in self.rig_files)

    def check_setups(self) -> None:
        """Check setups near the ends and in the middle of their distributions.

        Raises:
            OmnisimError: the first fault.
        """
        for share in map(ConstantShares, TRIED):
            for file in self.rig_files:
                if file.table.varies:
                    file.rig(share)
            if self.plan.vary.lights:
                for number in range(len(self.plan.scenes)):
                    draw_light(self.scene(number), self.plan.vary, share, self.path)

    @cached_property
    def objects(self) -> tuple[PlanObject, ...]:
        """Objects to place."""
        objects = []
        for table in self.plan.objects:
            scene = read_scene(
                self._scene_file(table), table.up_axis, table.meters_per_unit, animation="none"
            ).altered(name=table.title)
            low, high = scene.bounds_m()
            radius_m, middle_m = 0.5 * float(np.hypot(*(high - low)[:2])), 0.5 * (low + high)[:2]
            height_m = float(high[2] - low[2])
            objects.append(PlanObject(table.title, scene, low, radius_m, middle_m, height_m))
        return tuple(objects)

    @cached_property
    def poses(self) -> Floats:
        """Poses (n, 4, 4) of the plan's pose file; empty without one."""
        if self.plan.viewpoints.file is None:
            return np.zeros((0, 4, 4))
        return parse_trajectory(self.path.parent / self.plan.viewpoints.file).world_from_base

    @cached_property
    def fingerprint(self) -> str:
        """Hash of the plan, the contents of its files and omnisim's version; hexadecimal."""
        digest = hashlib.sha256(json.dumps(self.plan.content(), sort_keys=True).encode())
        scenes = [fingerprint(self.scene(number)) for number in range(len(self.plan.scenes))]
        objects = [fingerprint(moving.scene) for moving in self.objects]
        _ = self.rigs  # reports their faults first
        reader = SourceReader()
        for file in self.rig_files:
            reader.update(file.sources)
        if self.plan.viewpoints.file is not None:
            reader.note(self.path.parent / self.plan.viewpoints.file)
        for name in self.plan.sky_files:
            reader.note(self.path.parent / name)
        parts: list[Any] = [__version__, *scenes, *objects, reader.digest(self.path.parent)]
        for part in parts:
            digest.update(f"\n{part}".encode())
        return digest.hexdigest()[:16]
