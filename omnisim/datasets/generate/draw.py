"""Draws of samples: scene, rig, pose, colors and objects, as functions of seed and number."""

from __future__ import annotations

import colorsys
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omnisim.core import poses
from omnisim.core.arrays import Floats
from omnisim.core.errors import PlanError
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.core.srgb import linear_from_srgb
from omnisim.datasets.free_space import FreeSpace
from omnisim.datasets.generate.distributions import Distribution, RandomStream
from omnisim.datasets.generate.plan import Plan
from omnisim.datasets.generate.prepared_plan import PlanObject, PreparedPlan

# Purposes of streams: drawing one more number for one purpose changes no other.
_INDICES, _VIEWPOINT, _VARY, _COLORS, _OBJECTS = range(5)
MAX_TRIES = 200  # for an object's place at the required distances


@dataclass(frozen=True)
class SampleIndices:
    """Indices of a sample's scene, rig and setups, the same for all attempts."""

    scene: int  # index of the scene in the plan
    rig: int  # index of the rig in the plan
    light: int  # index of the light's setup; 0 if the light does not vary
    camera: int  # index of the cameras' setup; 0 if the cameras do not vary


@dataclass(frozen=True, eq=False)
class ObjectPlacement:
    """Object of a sample, with its pose."""

    name: str  # name of its instance
    object: int  # index of the object's table in the plan
    world_from_object: Floats  # (4, 4) pose


@dataclass(frozen=True, eq=False)
class Draw:
    """All inputs of one attempt at a sample."""

    number: int  # number of the sample
    attempt: int  # number of the attempt, from 0
    indices: SampleIndices  # indices of scene, rig and setups
    position_m: Floats  # (3,) viewpoint, before the shift
    # yaw_deg, pitch_deg, roll_deg: attitude of the vehicle
    yaw_deg: float
    pitch_deg: float
    roll_deg: float
    shift_m: tuple[float, float, float]  # (3,) shift of the camera along the vehicle's axes
    time_s: float  # time of the world
    exposure_ev: float  # exposure in stops, in addition to the camera's
    colors: dict[str, tuple[float, float, float]]  # linear RGB by instance name
    objects: tuple[ObjectPlacement, ...]  # placed objects


def draw_indices(plan: Plan, number: int) -> SampleIndices:
    """Draw the scene and the rig of a sample, and find its setups."""
    stream = RandomStream(plan.seed, number, 0, _INDICES)
    scene = stream.choose(range(len(plan.scenes)), [table.weight for table in plan.scenes])
    rig = stream.choose(range(len(plan.cameras)), [camera.weight for camera in plan.cameras])
    setup = number // plan.vary.images_per_setup
    varies = plan.cameras[rig].varies
    return SampleIndices(scene, rig, setup if plan.vary.lights else 0, setup if varies else 0)


def draw(prepared: PreparedPlan, number: int, attempt: int) -> Draw:
    """Draw all inputs of an attempt at a sample.

    Raises:
        OmnisimError: a faulty file of the plan, no free floor, or no room for an object.
    """
    plan = prepared.plan
    indices = draw_indices(plan, number)

    def stream(purpose: int) -> RandomStream:
        return RandomStream(plan.seed, number, attempt, purpose)

    place = _place(prepared, indices.scene, stream(_VIEWPOINT))
    vary, own = plan.vary, stream(_VARY)
    yaw_deg = vary.yaw_deg.draw(own)
    pitch_deg, roll_deg = vary.pitch_deg.draw(own), vary.roll_deg.draw(own)
    shift_m = (vary.shift_m.draw(own), vary.shift_m.draw(own), vary.shift_m.draw(own))
    if place.turns_along and "yaw_deg" not in vary.model_fields_set:
        yaw_deg = 0.0
    drawn = Draw(
        number=number,
        attempt=attempt,
        indices=indices,
        position_m=place.position_m,
        yaw_deg=place.yaw_deg + yaw_deg,
        pitch_deg=place.pitch_deg + pitch_deg,
        roll_deg=place.roll_deg + roll_deg,
        shift_m=shift_m,
        time_s=vary.time_s.draw(own),
        exposure_ev=vary.exposure_ev.draw(own),
        colors=_colors(prepared, indices.scene, stream(_COLORS)),
        objects=(),
    )
    if not prepared.objects:
        return drawn
    return dataclasses.replace(drawn, objects=_objects(prepared, drawn, stream(_OBJECTS)))


@dataclass(frozen=True, eq=False)
class _Viewpoint:
    """Viewpoint and its base attitude; drawn angles are added to it."""

    position_m: Floats  # (3,) position in the world
    # yaw_deg, pitch_deg, roll_deg: attitude
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    # the attitude follows a path, an object or a file; a drawn yaw is added only if the plan sets
    # `yaw_deg`
    turns_along: bool = False


def _place(prepared: PreparedPlan, scene: int, stream: RandomStream) -> _Viewpoint:
    table = prepared.plan.viewpoints
    match table.where:
        case "free":
            free = prepared.free_space(scene)
            cells = free.free_cells()
            cell = cells[stream.whole(len(cells))]
            on_floor = free.point_in(cell, (stream.share(), stream.share()))
            return _Viewpoint(on_floor + (0.0, 0.0, table.height_m.draw(stream)))
        case "path":
            return _along(prepared, scene, stream)
        case "around":
            # viewpoint at a drawn distance from an object, with the heading toward the object
            middle = stream.choose(prepared.middles(scene))
            distance_m = prepared.plan.viewpoints.distance_m.draw(stream)
            angle = 2.0 * math.pi * stream.share()
            point = middle[:2] + distance_m * np.array((math.cos(angle), math.sin(angle)))
            position_m = _above(prepared, scene, point, stream)
            return _Viewpoint(position_m, math.degrees(angle) - 180.0, turns_along=True)
        case _:
            pose = prepared.poses[stream.whole(len(prepared.poses))]
            roll, pitch, yaw = map(math.degrees, roll_pitch_yaw_from_rotation(pose[:3, :3]))
            return _Viewpoint(pose[:3, 3], yaw, pitch, roll, turns_along=True)


def _along(prepared: PreparedPlan, scene: int, stream: RandomStream) -> _Viewpoint:
    """Viewpoint on or beside a path, uniform along the paths' length, with the path's heading."""
    table, paths = prepared.plan.viewpoints, prepared.paths(scene)
    legs = np.concatenate([np.stack((path[:-1], path[1:]), axis=1) for path in paths])
    lengths = np.linalg.norm(legs[:, 1] - legs[:, 0], axis=1)
    begin, end = legs[stream.choose(range(len(legs)), lengths.tolist())]
    direction = (end - begin) / np.linalg.norm(end - begin)
    left = np.array((-direction[1], direction[0]))
    point = begin + stream.share() * (end - begin) + table.beside_m.draw(stream) * left
    yaw_deg = math.degrees(math.atan2(direction[1], direction[0]))
    return _Viewpoint(_above(prepared, scene, point, stream), yaw_deg, turns_along=True)


def _above(prepared: PreparedPlan, scene: int, point_m: Floats, stream: RandomStream) -> Floats:
    """Viewpoint (3,) above the floor at a point (2,).

    Without floor at the point, above the scene's lowest floor.
    """
    free = prepared.free_space(scene)
    cell = free.cell_of(point_m)
    floor_m = math.nan if cell is None else float(free.floor_m[cell])
    if math.isnan(floor_m):
        floor_m = float(np.nanmin(free.floor_m))
    return np.array((*point_m, floor_m + prepared.plan.viewpoints.height_m.draw(stream)))


def _colors(
    prepared: PreparedPlan, scene: int, stream: RandomStream
) -> dict[str, tuple[float, float, float]]:
    colors = {}
    for table in prepared.plan.vary.recolor:
        for name in prepared.instances(scene, table.nodes, "vary.recolor.nodes"):
            is_drawn = stream.share() < table.share
            parts = [
                distribution.draw(stream)
                for distribution in (table.hue_deg, table.saturation, table.value)
            ]
            if is_drawn:
                hue, saturation, value = parts
                rgb = colorsys.hsv_to_rgb(hue / 360.0 % 1.0, _unit(saturation), _unit(value))
                red, green, blue = linear_from_srgb(np.array(rgb)).tolist()
                colors[name] = (red, green, blue)
    return colors


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _objects(
    prepared: PreparedPlan, drawn: Draw, stream: RandomStream
) -> tuple[ObjectPlacement, ...]:
    """Objects on the free floor, apart from each other and from the viewpoint."""
    free = prepared.free_space(drawn.indices.scene)
    own_m = prepared.plan.viewpoints.radius_m
    occupied = [(drawn.position_m[:2], own_m)]
    placed = []
    for index, (table, shape) in enumerate(
        zip(prepared.plan.objects, prepared.objects, strict=True)
    ):
        min_count, max_count = table.count
        for number in range(min_count + stream.whole(max_count - min_count + 1)):
            point = _apart(free, occupied, shape, drawn.position_m[:2], table.distance_m, stream)
            occupied.append((point[:2], shape.radius_m))
            # rotated about its middle, and on the floor
            centered = np.eye(4)
            centered[:3, 3] = -shape.middle_m[0], -shape.middle_m[1], -shape.low_m[2]
            turn = poses.pose((0.0, 0.0, 0.0), yaw_deg=table.yaw_deg.draw(stream))
            world_from_object: Floats = turn @ centered
            world_from_object[:3, 3] += point
            placed.append(ObjectPlacement(f"{shape.title}_{number}", index, world_from_object))
    return tuple(placed)


def _apart(
    free: FreeSpace,
    occupied: Sequence[tuple[Floats, float]],
    shape: PlanObject,
    viewpoint_m: Floats,
    distance_m: Distribution,
    stream: RandomStream,
) -> Floats:
    """Draw a point (3,) on the floor at a distance from the viewpoint (2,) for an object.

    It is apart from the occupied circles: centers (2,) and radii in m.
    """
    for _ in range(MAX_TRIES):
        angle, distance = 2.0 * math.pi * stream.share(), distance_m.draw(stream)
        point = viewpoint_m + distance * np.array((math.cos(angle), math.sin(angle)))
        cell = free.cell_of(point)
        if cell is None or not free.clears(cell, shape.radius_m):
            continue
        if all(np.hypot(*(point - other)) > radius + shape.radius_m for other, radius in occupied):
            return np.array((*point, free.floor_m[cell]))
    raise PlanError(
        f"objects: {shape.title}: no free place of {shape.radius_m:.2g} m in {MAX_TRIES} draws: "
        "expected fewer or smaller objects, or another distance_m"
    )
