"""Primitives: vertex attributes and triangles, Draco-compressed or not; skins and morph targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Indices, Ints
from omnisim.core.errors import SceneError
from omnisim.core.extras import install_hint
from omnisim.core.short_repr import counted
from omnisim.scene.formats.gltf.document import Accessors, JsonObject
from omnisim.scene.formats.gltf.nodes import Animation, MovingNode
from omnisim.scene.formats.imported_scene import MAX_COORDINATE, make_mesh, translate
from omnisim.scene.motion.deformation import Deformation, MorphTargets, Skeleton
from omnisim.scene.motion.node_motion import Keyframes
from omnisim.scene.parts import Mesh

# OpenGL constants for `mode`
TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6
POINTS_AND_LINES = {0, 1, 2, 3}


class Primitive:
    """Triangle primitive with its arrays; `entry` is its JSON."""

    def __init__(self, entry: JsonObject, accessors: Accessors):
        """Decompress the primitive if necessary."""
        self.entry = entry
        self._accessors, self._attributes = accessors, entry.object("attributes")
        if draco := entry.extension("KHR_draco_mesh_compression"):
            self._decode_draco(draco)

    @property
    def normals(self) -> Floats | None:
        """Normals (n, 3) of the vertices; None: missing, or not one for each vertex."""
        normals = self.attribute("NORMAL")
        is_whole = normals is not None and normals.shape == self.required("POSITION", 3).shape
        return normals if is_whole else None

    @property
    def targets(self) -> list[JsonObject]:
        """Morph targets of the primitive."""
        return self.entry.objects("targets")

    def offsets(self, name: str, targets: Indices, count: int) -> Floats | None:
        """Offsets (targets, count, 3) of an attribute in the given targets; None: no offsets."""
        entries = self.targets
        target_objects = [entries[number] for number in targets.tolist()]
        if not any(target.has(name) for target in target_objects):
            return None
        offsets = np.zeros((len(target_objects), count, 3))
        for values, target in zip(offsets, target_objects, strict=True):
            if target.has(name):
                stored = self._accessors.floats(target, name)
                if stored.shape != values.shape:
                    raise target.error(name, f"an accessor of {count} VEC3")
                values[:] = stored
        return offsets

    def has(self, attribute: str) -> bool:
        """True if the primitive has an attribute."""
        return self._attributes.has(attribute)

    def attribute(self, name: str) -> Floats | None:
        """Vertex attribute (n, components); None: missing."""
        if not self.has(name):
            return None
        values = self._accessors.floats(self._attributes, name)
        if values.ndim != 2:
            raise self._attributes.error(name, "an accessor of vectors")
        return values

    def required(self, name: str, components: int) -> Floats:
        """Vertex attribute (n, components) that must exist."""
        values = self.attribute(name)
        if values is None or values.shape[1] != components:
            raise self._attributes.error(name, f"an accessor of VEC{components}")
        return values

    def triangles(self, vertex_count: int) -> Ints:
        """Vertex indices (m, 3) of the triangles.

        Source: glTF 2.0, section 3.7.2.1.
        """
        order = np.arange(vertex_count)
        if self.entry.has("indices"):
            order = self._accessors.integers(self.entry, "indices").ravel()
        mode = self.entry.integer("mode", TRIANGLES)
        if mode == TRIANGLES and len(order) % 3 == 0:
            return order.reshape(-1, 3)
        if mode == TRIANGLE_FAN:
            hub = np.repeat(order[:1], max(len(order) - 2, 0))
            return np.stack((hub, order[1:-1], order[2:]), axis=1)
        if mode == TRIANGLE_STRIP:
            strip = np.stack((order[:-2], order[1:-1], order[2:]), axis=1)
            strip[1::2] = strip[1::2, ::-1]  # every other triangle of a strip is wound in reverse
            return strip
        raise self.entry.error("mode", f"0 to 6, and triangles of 3 of the {len(order)} indices")

    def _decode_draco(self, draco: JsonObject) -> None:
        try:
            import DracoPy
        except ImportError:
            raise SceneError(
                f"is compressed with Draco, which needs {install_hint('draco')}"
            ) from None
        try:
            mesh = DracoPy.decode(bytes(self._accessors.view(draco)))
        except Exception as reason:  # DracoPy documents no exceptions
            raise SceneError(f"{draco.place}: cannot be decoded: {reason!s:.80}") from None
        values = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
        ids = draco.object("attributes")
        for name in ids:
            if self._attributes.has(name) and ids.integer(name) in values:
                self._accessors.replace(self._attributes, name, values[ids.integer(name)])
        faces: NDArray[np.uint32] | None = getattr(mesh, "faces", None)  # not in point clouds
        if faces is not None and self.entry.has("indices"):
            self._accessors.replace(self.entry, "indices", faces)


# Meshes of skinned, morphed or non-rigidly moving nodes, static or animated.

_CHECKS = 32  # samples of a mesh's extent over the animation
_SUM_TOLERANCE = 0.01  # for sums of weights, above the rounding of four 8-bit weights
_SINGULAR = 1e-12  # minimum determinant of a bind matrix, relative to its cubed scale


class DeformedMesh(NamedTuple):
    """Mesh of a node's primitive, with its pose."""

    mesh: Mesh  # mesh at 0 s
    file_from_mesh: Floats  # (4, 4) transform
    owner: int | None  # index of the node that moves the mesh; None: placed by its joints or static


@dataclass(frozen=True)
class PlayedNodes:
    """Nodes of the scene and their motion in the played animation."""

    nodes: list[JsonObject]  # all nodes of the file
    poses: Mapping[int, Floats]  # (4, 4) file_from_node of the scene's nodes at 0 s, by node index
    moved: Mapping[int, MovingNode]  # moving nodes, by node index
    reshaped: set[int]  # indices of mesh nodes with non-rigid motion
    animation: Animation  # animation to play
    world_from_file: Floats  # (4, 4) transform


class DeformingMeshes:
    """Builder of deforming meshes."""

    def __init__(self, root: JsonObject, accessors: Accessors, played: PlayedNodes):
        self._skins, self._meshes = root.objects("skins"), root.objects("meshes")
        self._accessors, self._played = accessors, played
        self._skeletons: dict[int, Skeleton] = {}
        self._mended = self._singular = 0

    @property
    def notices(self) -> list[str]:
        """One line for each kind of repaired fault."""
        notices = []
        if self._mended:
            vertices = counted(self._mended, "vertex", "vertices")
            notices.append(
                f"weights of joints do not add up to 1: they are normalized ({vertices})"
            )
        if self._singular:
            joints = counted(self._singular, "joint")
            notices.append(f"inverse bind matrices are singular: meshes are flattened ({joints})")
        return notices

    def make(self, index: int, primitive: Primitive, plain: Mesh) -> DeformedMesh | None:
        """Deforming mesh of a node's primitive; None: use the plain mesh."""
        node = self._played.nodes[index]
        is_skinned = node.has("skin") and primitive.has("JOINTS_0")
        morphed = self._morph(index, primitive)
        if is_skinned:
            number = node.index("skin", self._skins)
            skeleton = self._skeleton(number)
            weights = joint_weights(primitive, len(skeleton.nodes))
            self._mended += weights.mended
        elif index in self._played.reshaped:
            _, moving, owner_from_node = self._played.moved[index]
            skeleton = Skeleton((moving,), owner_from_node[None])
            weights = _one_joint(len(primitive.required("POSITION", 3)))
        elif morphed is not None:
            return self._by_its_node(index, plain, morphed)
        else:
            return None
        if morphed is None:
            morphed = MorphedVertices(primitive.required("POSITION", 3), primitive.normals, None)
        if is_skinned and not skeleton.moves and morphed.targets is None:
            world_from_bind = skeleton.matrices_at(0.0)
            file_from_bind = np.linalg.inv(self._played.world_from_file) @ world_from_bind
            skinned = skin_vertices(morphed.positions, morphed.normals, weights, file_from_bind)
            mesh, center = _remade(plain, *skinned)
            return DeformedMesh(mesh, translate(np.eye(4), center), None)
        if not is_skinned and np.linalg.det(self._played.poses[index][:3, :3]) < 0.0:
            plain = replace(plain, triangles=plain.triangles[:, (0, 2, 1)])
        file_from_world = np.linalg.inv(self._played.world_from_file).astype(np.float64)
        mesh, center = _deforming(plain, morphed, weights, skeleton, file_from_world)
        self._check(mesh)
        return DeformedMesh(mesh, translate(np.eye(4), center), None)

    def _morph(self, index: int, primitive: Primitive) -> MorphedVertices | None:
        """Vertices with morph targets; None: no target has an effect."""
        if not primitive.targets:
            return None
        node, animation = self._played.nodes[index], self._played.animation
        holder = node if node.has("weights") else self._meshes[node.index("mesh", self._meshes)]
        weights = holder.numbers("weights", len(holder.array("weights"))) or ()
        animated = animation.weights.get(index)
        if animated is None and not any(weights):
            return None
        return morph(primitive, weights, animated, animation.period_s)

    def _by_its_node(self, index: int, plain: Mesh, morphed: MorphedVertices) -> DeformedMesh:
        pose = self._played.poses[index]
        if morphed.targets is None:
            mesh, center = _remade(plain, morphed.positions, morphed.normals)
            return DeformedMesh(mesh, translate(pose, center), index)
        rest = Skeleton((None,), np.eye(4)[None])
        weights = _one_joint(len(morphed.positions))
        mesh, center = _deforming(plain, morphed, weights, rest, np.eye(4))
        return DeformedMesh(mesh, translate(pose, center), index)

    def _check(self, mesh: Mesh) -> None:
        assert mesh.deformation is not None
        for time_s in np.linspace(0.0, self._played.animation.period_s, _CHECKS).tolist():
            center, radius = mesh.deformation.sphere_at(time_s)
            if not np.abs(center).max() + radius < MAX_COORDINATE:  # false for NaN as well
                raise SceneError(
                    f"mesh {mesh.name!r}: expected finite coordinates below "
                    f"{MAX_COORDINATE:g} in its animation, got others at {time_s:g} s"
                )

    @np.errstate(all="ignore")
    def _skeleton(self, number: int) -> Skeleton:
        """Skeleton of a skin, whose joints must be nodes of the scene.

        Source: glTF 2.0, section 3.7.3.3: a joint's global transform times its inverse bind matrix;
        the node of the mesh is ignored.
        """
        if number in self._skeletons:
            return self._skeletons[number]
        skin, played = self._skins[number], self._played
        joints = skin.indices("joints", range(1 + max(played.poses)))
        if not played.poses.keys() >= set(joints):
            raise skin.error("joints", "nodes of the scene")
        binds = np.tile(np.eye(4), (len(joints), 1, 1))
        if skin.has("inverseBindMatrices"):  # stored in column-major order
            binds = self._accessors.floats(skin, "inverseBindMatrices").swapaxes(1, -1)
            if binds.shape != (len(joints), 4, 4):
                raise skin.error("inverseBindMatrices", f"an accessor of {len(joints)} MAT4")
        scales = np.abs(binds[:, :3, :3]).max(axis=(1, 2))
        determinants = np.abs(np.linalg.det(binds[:, :3, :3]))
        self._singular += int((~(determinants > _SINGULAR * scales**3)).sum())
        moved = [played.moved.get(joint) for joint in joints]
        offsets = [
            played.world_from_file @ played.poses[joint] if node is None else node.owner_from_node
            for joint, node in zip(joints, moved, strict=True)
        ]
        nodes = tuple(None if node is None else node.node for node in moved)
        self._skeletons[number] = Skeleton(nodes, np.array(offsets).reshape(-1, 4, 4) @ binds)
        return self._skeletons[number]


def _one_joint(count: int) -> JointWeights:
    return JointWeights(np.zeros((count, 1), dtype=np.int64), np.ones((count, 1)), 0)


@np.errstate(all="ignore")  # a mesh with non-finite values is rejected later
def _deforming(
    plain: Mesh,
    morphed: MorphedVertices,
    weights: JointWeights,
    skeleton: Skeleton,
    file_from_world: Floats,
) -> tuple[Mesh, Floats]:
    """Mesh at 0 s with its deformation, and its origin (3,)."""
    normals = morphed.normals
    deformation = Deformation(
        morphed.positions.astype(np.float32),
        None if normals is None else normals.astype(np.float32),
        weights.joints.astype(np.uint32),
        weights.shares.astype(np.float32),
        file_from_world,
        skeleton,
        morphed.targets,
    )
    mesh, center = _remade(plain, deformation.positions_at(0.0), deformation.normals_at(0.0))
    if mesh.normals is None:
        deformation = replace(deformation, normals=None)
    shift = translate(np.eye(4), -center)
    deformation = replace(deformation, mesh_from_world=shift @ file_from_world)
    return replace(mesh, deformation=deformation), center


def _remade(plain: Mesh, positions: Floats, normals: Floats | None) -> tuple[Mesh, Floats]:
    """Copy of a mesh with other positions and normals, and its origin (3,)."""
    return make_mesh(
        plain.name, plain.material, positions, plain.triangles,
        normals, plain.texture_coordinates, plain.colors, plain.second_texture_coordinates,
    )  # fmt: skip


class MorphedVertices(NamedTuple):
    """Vertices of a primitive before skinning."""

    positions: Floats  # (n, 3), morphed by static weights
    normals: Floats | None  # (n, 3), morphed by static weights; None: no normals
    targets: MorphTargets | None  # targets with animated weights; None: no animated weights


def morph(
    primitive: Primitive, weights: tuple[float, ...], animated: Keyframes | None, period_s: float
) -> MorphedVertices:
    """Morph a primitive by static weights, or set up targets with animated ones."""
    positions, normals = primitive.required("POSITION", 3), primitive.normals
    count = len(primitive.targets)
    if animated is not None and animated.is_constant:
        weights, animated = tuple(animated.values[0].tolist()), None
    values = np.zeros(count)
    values[: len(weights)] = weights[:count]
    if animated is not None:
        values = np.abs(animated.values[:, :count]).max(axis=0)
        for tangents in (animated.in_tangents, animated.out_tangents):
            if tangents is not None:
                values = np.maximum(values, np.abs(tangents[:, :count]).max(axis=0))
    used = np.flatnonzero(values)
    if not len(used):
        return MorphedVertices(positions, normals, None)
    offsets = primitive.offsets("POSITION", used, len(positions))
    normal_offsets = primitive.offsets("NORMAL", used, len(positions))
    if offsets is None:
        offsets = np.zeros((len(used), *positions.shape))
    if animated is None:
        positions = positions + np.einsum("t,tnc->nc", values[used], offsets)
        if normals is not None and normal_offsets is not None:
            normals = normals + np.einsum("t,tnc->nc", values[used], normal_offsets)
        return MorphedVertices(positions, normals, None)
    before, after = animated.in_tangents, animated.out_tangents
    keyframes = replace(
        animated,
        values=animated.values[:, used],
        in_tangents=None if before is None else before[:, used],
        out_tangents=None if after is None else after[:, used],
    )
    small = None if normal_offsets is None else normal_offsets.astype(np.float32)
    targets = MorphTargets(offsets.astype(np.float32), small, keyframes, period_s)
    return MorphedVertices(positions, normals, targets)


class JointWeights(NamedTuple):
    """Joints of a primitive's vertices, up to eight per vertex."""

    joints: Ints  # (n, k) joint indices
    # (n, k) weights, which sum to 1; a vertex without weights follows its first joint
    shares: Floats
    mended: int  # number of vertices whose weights in the file do not sum to 1


@np.errstate(all="ignore")  # a mesh with non-finite values is rejected later
def joint_weights(primitive: Primitive, joint_count: int) -> JointWeights:
    """Joints and weights of a primitive, for a skin with `joint_count` joints."""
    sets = ["0", "1"] if primitive.has("JOINTS_1") and primitive.has("WEIGHTS_1") else ["0"]
    count = len(primitive.required("POSITION", 3))
    joints, weights = (
        np.concatenate([primitive.required(f"{name}_{index}", 4) for index in sets], axis=1)
        if {len(primitive.required(f"{name}_{index}", 4)) for index in sets} == {count}
        else None
        for name in ("JOINTS", "WEIGHTS")
    )
    if joints is None or weights is None:
        raise primitive.entry.error("attributes", "as many JOINTS and WEIGHTS as POSITION")
    if not ((joints >= 0) & (joints < joint_count)).all():  # rejects NaN as well
        raise primitive.entry.error("attributes", f"JOINTS below {joint_count}")
    if not np.isfinite(weights).all():
        raise primitive.entry.error("attributes", "finite WEIGHTS")
    total = weights.sum(axis=1, keepdims=True)
    shares = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0.0)
    shares[~(total[:, 0] > 0.0), 0] = 1.0
    mended = int((np.abs(total - 1.0) > _SUM_TOLERANCE).sum())
    return JointWeights(joints.astype(np.int64), shares, mended)


@np.errstate(all="ignore")
def skin_vertices(
    positions: Floats, normals: Floats | None, weights: JointWeights, matrices: Floats
) -> tuple[Floats, Floats | None]:
    """Positions (n, 3) and normals (n, 3) of a static skin, from matrices (joints, 4, 4)."""
    blended = np.einsum("nj,njab->nab", weights.shares, matrices[weights.joints])
    skinned = np.einsum("nab,nb->na", blended[:, :3, :3], positions) + blended[:, :3, 3]
    if normals is None:
        return skinned, None
    return skinned, np.einsum("nab,nb->na", blended[:, :3, :3], normals)
