"""Nodes: their hierarchy, copies, lights and animations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.poses import proper_rotation, rotation_from_quaternion
from omnisim.scene.formats.gltf.document import Accessors, JsonObject
from omnisim.scene.formats.imported_scene import ImportedObject, unique_name
from omnisim.scene.labels import BODY
from omnisim.scene.model import Light, LightKind
from omnisim.scene.motion.node_motion import (
    AnimatedNode,
    Interpolation,
    Keyframes,
    NodeMotion,
    local_transform,
)


def scene_parents(root: JsonObject, nodes: list[JsonObject]) -> dict[int, int | None]:
    """Parent of each node of the file's scene, in drawing order.

    Without any scene, all root nodes are drawn.
    """
    scenes = root.objects("scenes")
    if scenes:
        scene = scenes[root.index("scene", scenes) if root.has("scene") else 0]
        roots = scene.indices("nodes", nodes)
    else:
        children = {child for node in nodes for child in node.indices("children", nodes)}
        roots = [index for index in range(len(nodes)) if index not in children]
    parents: dict[int, int | None] = {}
    stack: list[tuple[int, int | None]] = [(index, None) for index in roots]
    while stack:  # depth first, last child first: instance labels follow this order
        index, parent = stack.pop()
        if index in parents:
            raise SceneError(f"nodes[{index}]: expected one parent, got two, or itself as ancestor")
        parents[index] = parent
        stack += [(child, index) for child in nodes[index].indices("children", nodes)]
    return parents


def parent_from_node(node: JsonObject) -> Floats:
    """Local transform (4, 4): the matrix, or translation · rotation · scale."""
    result = np.eye(4)
    if (matrix := node.numbers("matrix", 16)) is not None:
        result = _orthonormalize(np.reshape(matrix, (4, 4)).T)
    if (translation := node.numbers("translation", 3)) is not None:
        shift = np.eye(4)
        shift[:3, 3] = translation
        result = result @ shift
    quaternion = node.numbers("rotation", 4)
    if quaternion is not None and np.linalg.norm(quaternion) > 1e-7:
        rotation = np.eye(4)
        rotation[:3, :3] = rotation_from_quaternion(quaternion)
        result = result @ rotation
    if (scale := node.numbers("scale", 3)) is not None:
        result = result @ np.diag((*scale, 1.0))
    return result


def _orthonormalize(matrix: Floats) -> Floats:
    """Matrix (4, 4), orthonormalized if it is rigid or mirrored up to the file's rounding."""
    linear = matrix[:3, :3]
    error = np.abs(linear @ linear.T - np.eye(3)).max()
    if not 1e-13 < error < 1e-5:
        return matrix
    left, _, right = np.linalg.svd(linear)
    rigid = matrix.copy()
    rigid[:3, :3] = left @ right
    return rigid


# Instanced copies of a node's mesh.
#
# Source: EXT_mesh_gpu_instancing.

MAX_COPIES = 200_000
_COMPONENTS = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}


def read_copies(node: JsonObject, accessors: Accessors) -> Floats | None:
    """Transforms (n, 4, 4) node_from_copies of a node's copies; None: no instancing."""
    extension = node.extension("EXT_mesh_gpu_instancing")
    if extension is None:
        return None
    entry = extension.object("attributes")
    values_of: dict[str, Floats] = {}
    count: int | None = None
    for name, components in _COMPONENTS.items():
        if not entry.has(name):
            continue
        values = accessors.floats(entry, name)
        count = len(values) if count is None else count
        if values.shape != (count, components) or not np.isfinite(values).all():
            raise entry.error(name, f"an accessor of {count} finite VEC{components}")
        if count > MAX_COPIES:
            raise entry.error(name, f"an accessor of at most {MAX_COPIES} copies")
        values_of[name] = values
    if count is None:
        return None
    matrices = np.tile(np.eye(4), (count, 1, 1))
    if "ROTATION" in values_of and count:
        turns = values_of["ROTATION"]
        turns[np.linalg.norm(turns, axis=1) < 1e-7] = (0.0, 0.0, 0.0, 1.0)
        matrices[:, :3, :3] = rotation_from_quaternion(turns)
    if "SCALE" in values_of:
        matrices[:, :3, :3] *= values_of["SCALE"][:, None, :]
    if "TRANSLATION" in values_of:
        matrices[:, :3, 3] = values_of["TRANSLATION"]
    return matrices


# Punctual lights.

_EXTENSION = "KHR_lights_punctual"
_KINDS = {kind.value: kind for kind in LightKind}


def read_lights(
    root: JsonObject, nodes: list[JsonObject], world_from_nodes: dict[int, Floats]
) -> tuple[Light, ...]:
    """Lights of the scene's nodes, in the world frame.

    Source: KHR_lights_punctual; a light shines along −z of its node.
    """
    extension = root.extension(_EXTENSION)
    entries = extension.objects("lights") if extension else []
    lights = []
    for index in sorted(world_from_nodes):
        reference = nodes[index].extension(_EXTENSION)
        if reference is None:
            continue
        entry = entries[reference.index("light", entries)]
        world_from_light = world_from_nodes[index]
        kind, axis = _KINDS.get(entry.text("type", "")), -world_from_light[:3, 2]
        length = np.linalg.norm(axis)
        if kind is None or length == 0.0:
            continue
        red, green, blue = entry.numbers("color", 3) or (1.0, 1.0, 1.0)
        range_m, spot = entry.number("range", 0.0), entry.object("spot")
        inner = spot.number("innerConeAngle", 0.0)
        outer = spot.number("outerConeAngle", math.pi / 4.0)
        lights.append(
            Light(
                kind,
                (red, green, blue),
                entry.number("intensity", 1.0),
                position_m=world_from_light[:3, 3],
                direction=axis / length,
                range_m=range_m if range_m > 0.0 else math.inf,
                cone_cosines=(math.cos(inner), math.cos(outer)),
            )
        )
    return tuple(lights)


# Animations: keyframes of nodes and weights, and the nodes that they move.

NO_ANIMATION = "none"
_WEIGHTS = "weights"
_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
_REST = {"translation": (0.0,) * 3, "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0,) * 3}
_INTERPOLATIONS: dict[int | str, Interpolation] = {kind.value: kind for kind in Interpolation}
Properties = dict[str, Keyframes]


class AnimationChoice(NamedTuple):
    """Choice of the animation to play."""

    # animation name; None: the first animation; `NO_ANIMATION`: no animation
    name: str | None = None
    # turn moving nodes into dynamic objects; False: deform their meshes only
    moves_objects: bool = True


FIRST_ANIMATION = AnimationChoice()


@dataclass
class Animation:
    """Animation to play."""

    # keyframes of translation, rotation and scale, by node index
    nodes: dict[int, Properties] = field(default_factory=dict)
    # keyframes of the morph target weights, by node index
    weights: dict[int, Keyframes] = field(default_factory=dict)
    period_s: float = 0.0  # period after which the animation repeats
    channels: Sequence[JsonObject] = ()  # JSON of the animation's channels
    others: Sequence[JsonObject] = ()  # animations that are not played, if none was chosen by name

    @property
    def moving(self) -> list[int]:
        """Indices of the nodes with non-constant keyframes."""
        return [
            index
            for index, properties in self.nodes.items()
            if not all(keyframes.is_constant for keyframes in properties.values())
        ]


def read_animation(
    root: JsonObject, nodes: list[JsonObject], accessors: Accessors, name: str | None
) -> Animation:
    """Read an animation by name; None: the first."""
    entries = root.objects("animations")
    if name == NO_ANIMATION or (name is None and not entries):
        return Animation(others=entries)
    names = [entry.text("name", f"animation {index}") for index, entry in enumerate(entries)]
    if name is not None and name not in names:
        hint = did_you_mean(name, [*names, NO_ANIMATION], "the file has")
        raise SceneError(f"animation = {name!r}: unknown; {hint}")
    entry = entries[0 if name is None else names.index(name)]
    others = entries[1:] if name is None else ()
    animation = Animation(channels=entry.objects("channels"), others=others)
    samplers, meshes = entry.objects("samplers"), root.objects("meshes")
    for channel in animation.channels:
        target = channel.object("target")
        path = target.text("path", "")
        if path not in (*_WIDTHS, _WEIGHTS) or not target.has("node"):
            continue
        index = target.index("node", nodes)
        width = _WIDTHS.get(path, 0)
        if path == _WEIGHTS and nodes[index].has("mesh"):
            primitives = meshes[nodes[index].index("mesh", meshes)].objects("primitives")
            width = max((len(primitive.array("targets")) for primitive in primitives), default=0)
        if not width:  # weights of a mesh without morph targets
            continue
        sampler = samplers[channel.index("sampler", samplers)]
        keyframes = _keyframes(sampler, accessors, path, width)
        animation.period_s = max(animation.period_s, float(keyframes.times_s[-1]))
        if path == _WEIGHTS:
            animation.weights[index] = keyframes
        else:
            animation.nodes.setdefault(index, {})[path] = keyframes
    return animation


def _keyframes(sampler: JsonObject, accessors: Accessors, path: str, width: int) -> Keyframes:
    times_s = accessors.floats(sampler, "input").ravel()
    if not len(times_s) or not (np.isfinite(times_s) & (times_s >= 0.0)).all():
        raise sampler.error("input", "an accessor of finite times ≥ 0")
    if (np.diff(times_s) < 0.0).any():
        raise sampler.error("input", "an accessor of times that increase")
    interpolation = Interpolation.LINEAR
    if sampler.has("interpolation"):
        interpolation = sampler.choice("interpolation", _INTERPOLATIONS)
    is_spline = interpolation is Interpolation.CUBIC_SPLINE
    rows = len(times_s) * (3 if is_spline else 1)
    values, what = accessors.floats(sampler, "output"), f"{rows} finite VEC{width}"
    if path == _WEIGHTS:
        what = f"{rows * width} finite SCALAR"
        if values.shape == (rows * width, 1):
            values = values.reshape(rows, width)
    if values.shape != (rows, width) or not np.isfinite(values).all():
        raise sampler.error("output", f"an accessor of {what}")
    before = after = None
    if is_spline:
        before, values, after = values[::3], values[1::3], values[2::3]
    is_rotation = path == "rotation"
    return Keyframes(times_s, values, interpolation, before, after, are_rotations=is_rotation)


def transform_at_start(node: JsonObject, animated: Properties | None) -> Floats:
    """Local transform (4, 4) of a node at 0 s; None: without keyframes."""
    if not animated:
        return parent_from_node(node)
    return _before(node) @ local_transform(*_start(node, animated))


class MovingNode(NamedTuple):
    """Node that moves with the animation, by its own keyframes or by an ancestor's."""

    owner: int  # index of the nearest node with keyframes: itself or an ancestor
    node: AnimatedNode  # animated node of the owner
    owner_from_node: Floats  # (4, 4) transform


def animated_nodes(
    nodes: list[JsonObject],
    parents: Mapping[int, int | None],
    local: Mapping[int, Floats],
    animation: Animation,
    world_from_file: Floats,
) -> dict[int, MovingNode]:
    """Nodes that move with the animation, by node index.

    `parents` are those of `scene_parents`, and `local` the transforms (4, 4) of the nodes at 0 s.
    """
    moving = set(animation.moving)
    moved: dict[int, MovingNode] = {}
    offsets: dict[int | None, Floats] = {None: world_from_file}
    for index, parent in parents.items():
        above = None if parent is None else moved.get(parent)
        # relative to the nearest moving ancestor, or to the world
        offset = offsets[parent]
        if index in moving:
            node = nodes[index]
            properties = animation.nodes[index]
            translation, rotation, scale = (
                keyframes
                if (keyframes := properties.get(key)) and not keyframes.is_constant
                else constant
                for key, constant in zip(_WIDTHS, _start(node, properties), strict=True)
            )
            animated = AnimatedNode(
                None if above is None else above.node,
                offset @ _before(node),
                translation,
                rotation,
                scale,
                animation.period_s,
            )
            offsets[index] = np.eye(4)
            moved[index] = MovingNode(index, animated, offsets[index])
        else:
            offsets[index] = offset @ local[index]
            if above is not None:
                moved[index] = MovingNode(above.owner, above.node, offsets[index])
    return moved


def _before(node: JsonObject) -> Floats:
    matrix = node.numbers("matrix", 16)
    return np.eye(4) if matrix is None else np.reshape(matrix, (4, 4)).T


def _start(node: JsonObject, properties: Properties) -> tuple[Floats, Floats, Floats]:
    translation, rotation, scale = (
        properties[key].at(0.0)
        if key in properties
        else np.array(node.numbers(key, width) or _REST[key])
        for key, width in _WIDTHS.items()
    )
    return translation, rotation, scale


# Dynamic objects of an animation, its non-rigid nodes, and its unplayed parts.

_CHECKS = 32  # samples of a node's motion over the animation
Moved = Mapping[int, MovingNode]


def moving_objects(
    nodes: list[JsonObject], owners: Sequence[int | None], moved: Moved, world_from_file: Floats
) -> tuple[ImportedObject, ...]:
    """Dynamic objects, one for each moving node with instances.

    `owners` are the indices of the instances' moving nodes; None: a static instance.
    """
    instances: dict[int, list[int]] = {}
    for number, owner in enumerate(owners):
        if owner is not None and owner in moved:
            instances.setdefault(moved[owner].owner, []).append(number)
    used_names, objects = {BODY}, []
    for index, numbers in instances.items():
        name = unique_name(nodes[index].text("name", f"node {index}"), used_names, first=1)
        node = moved[index].node
        linear = node.transform_at(0.0)[:3, :3] @ np.linalg.inv(world_from_file[:3, :3])
        motion = NodeMotion(node, proper_rotation(linear))
        objects.append(ImportedObject(name, motion, tuple(numbers)))
    return tuple(objects)


def reshaped_nodes(nodes: list[JsonObject], moved: Moved, animation: Animation) -> set[int]:
    """Indices of mesh nodes with non-rigid motion: their scale or shear changes."""
    times_s = np.linspace(0.0, animation.period_s, _CHECKS, endpoint=False).tolist()
    is_rigid: dict[int, bool] = {}
    reshaped = set()
    for index, (owner, node, _) in moved.items():
        if not nodes[index].has("mesh"):
            continue
        if owner not in is_rigid:
            motion = NodeMotion(node, np.eye(3))
            is_rigid[owner] = all(map(motion.is_rigid_at, times_s))
        if not is_rigid[owner]:
            reshaped.add(index)
    return reshaped
