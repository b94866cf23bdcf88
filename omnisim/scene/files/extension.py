"""Changes by a scene's TOML file: content of its base scene, materials, objects, light."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, assert_never

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError, TrajectoryError, did_you_mean
from omnisim.core.files.sources import SourceReader
from omnisim.core.files.toml_file import find_beside
from omnisim.core.poses import inverse, pose_from_rotation, rotation_from_yaw
from omnisim.scene import model
from omnisim.scene.files import scene_file
from omnisim.scene.formats.imported_scene import ImportedObject
from omnisim.scene.light.light_tables import LampTable, SunTable
from omnisim.scene.light.lighting import FILL_AMBIENT, expose, is_even
from omnisim.scene.light.sky import sun_illuminance_lx, sun_position
from omnisim.scene.motion.object_motion import Along, FreeBody, Orbit, Rest, Rolling, Shuttle
from omnisim.scene.surface_kind import SurfaceKind, kind_of

Named = Sequence[model.NamedStart | model.ScenePath | model.Landmark | model.DynamicObject]


def extend(base: model.Scene, additions: model.Scene, source: str) -> model.Scene:
    """Scene of the additions, with the starts, paths and landmarks of the base before their own.

    `source` names the additions in messages.

    Raises:
        SceneError: a name that both scenes have.
    """
    _check_distinct(base.starts, additions.starts, f"{source}: starts")
    _check_distinct(base.paths, additions.paths, f"{source}: paths")
    _check_distinct(base.landmarks, additions.landmarks, f"{source}: landmarks")
    return dataclasses.replace(
        additions,
        starts=(*base.starts, *additions.starts),
        paths=(*base.paths, *additions.paths),
        landmarks=(*base.landmarks, *additions.landmarks),
    )


def with_objects(
    scene: model.Scene, objects: tuple[model.DynamicObject, ...], source: str
) -> model.Scene:
    """Scene with additional dynamic objects.

    Raises:
        SceneError: a name that the scene already has.
    """
    if not objects:
        return scene
    _check_distinct(scene.objects, objects, f"{source}: objects", "the scene")
    return dataclasses.replace(scene, objects=(*scene.objects, *objects))


def with_moving_instances(scene: model.Scene, objects: Sequence[ImportedObject]) -> model.Scene:
    """Scene in which a file's moving instances become dynamic objects."""
    if not objects:
        return scene
    moving = {number for moving_object in objects for number in moving_object.instances}
    static_numbers = [number for number in range(len(scene.instances)) if number not in moving]
    new_objects = tuple(
        model.DynamicObject(
            moving_object.name,
            dataclasses.replace(
                _part(scene, moving_object.instances, inverse(moving_object.motion.pose_at(0.0))),
                name=moving_object.name,
                notices=(), starts=(), paths=(), landmarks=(), cameras=(),
            ),
            moving_object.motion,
        )
        for moving_object in objects
    )  # fmt: skip
    return dataclasses.replace(_part(scene, static_numbers, np.eye(4)), objects=new_objects)


def _part(scene: model.Scene, numbers: Sequence[int], part_from_world: Floats) -> model.Scene:
    """Scene with some of the instances, and only the meshes and materials that they use."""
    instances = [scene.instances[number] for number in numbers]
    mesh_at = {
        number: at for at, number in enumerate(sorted({instance.mesh for instance in instances}))
    }
    meshes = [scene.meshes[number] for number in mesh_at]
    material_at = {
        number: at for at, number in enumerate(sorted({mesh.material for mesh in meshes}))
    }
    return dataclasses.replace(
        scene,
        meshes=tuple(
            dataclasses.replace(mesh, material=material_at[mesh.material]) for mesh in meshes
        ),
        materials=tuple(scene.materials[number] for number in material_at),
        instances=tuple(
            model.Instance(
                instance.name,
                mesh_at[instance.mesh],
                part_from_world @ instance.world_from_mesh,
                part_from_world @ instance.world_from_node,
            )
            for instance in instances
        ),
    )


def _check_distinct(
    first: Named, second: Named, where: str, whose: str = "the scene that it extends"
) -> None:
    names = {each.name for each in first}
    for each in second:
        if each.name in names:
            raise SceneError(f"{where}: name = {each.name!r}: {whose} already has one")


# Changes of materials by the [[materials]] tables of a scene's TOML file.


_WITH_GLOSS = ("roughness", "ior", "specular_color")


def with_materials(
    scene: model.Scene, tables: Sequence[scene_file.MaterialTable], source: Path
) -> model.Scene:
    """Scene with materials, also of its dynamic objects, changed by tables in their order.

    `source` is the tables' file, for messages.

    Raises:
        SceneError: a pattern without a matching material.
    """
    if not tables:
        return scene
    shapes = (scene, *(moving.shape for moving in scene.objects))
    names = dict.fromkeys(material.name for shape in shapes for material in shape.materials)
    notices = list(scene.notices)
    if scene.lighting.is_matte:
        notices.append(
            f"{source.name}: materials: only base_color has an effect, as shading is 'matte'"
        )
    changes_of: dict[str, dict[str, Any]] = {}
    for number, table in enumerate(tables):
        for pattern in table.names:
            wildcards = pattern.replace("[", "[[]")  # only * and ? are wildcards
            matched = [name for name in names if fnmatchcase(name, wildcards)]
            if not matched:
                hint = did_you_mean(pattern, names, "the scene has")
                raise SceneError(
                    f"{source}: materials.{number}.names: no material {pattern!r}; {hint}"
                )
            for name in matched:
                changes_of.setdefault(name, {}).update(table.changes)
    changed: dict[int, model.Material] = {}
    for shape in shapes:
        for material in shape.materials:
            if material.name in changes_of and id(material) not in changed:
                changes = changes_of[material.name]
                changed[id(material)] = _changed(material, changes)
                notices += _without_effect(changed[id(material)], changes, source.name)
    objects = tuple(
        dataclasses.replace(moving, shape=_with_changed(moving.shape, changed))
        for moving in scene.objects
    )
    scene = _with_changed(scene, changed)
    return dataclasses.replace(scene, objects=objects, notices=tuple(dict.fromkeys(notices)))


def changes_light(before: model.Scene, after: model.Scene) -> bool:
    """True if other materials change the light on static surfaces, and so a bake.

    The roughness and strength of gloss do not, unless it is a mirror: bakes spread what it reflects
    like a matte surface. For mirrors and glass all properties count.
    """
    if len(before.materials) != len(after.materials):  # a slab of glass begins or ends
        return True
    pairs = zip(before.materials, after.materials, strict=True)
    return any(_lit_properties(one) != _lit_properties(other) for one, other in pairs)


def _changed(material: model.Material, changes: Mapping[str, Any]) -> model.Material:
    """Material with other properties; one that begins to transmit light is no longer blended."""
    properties = dict(changes)
    alpha = material.base_color[3]
    if properties.get("transmission") and material.alpha_mode is model.AlphaMode.BLEND:
        properties["alpha_mode"], alpha = model.AlphaMode.OPAQUE, 1.0
    red, green, blue = properties.get("base_color", material.base_color[:3])
    properties["base_color"] = (red, green, blue, alpha)
    return dataclasses.replace(material, **properties)


def _without_effect(material: model.Material, changes: Mapping[str, Any], source: str) -> list[str]:
    """Notices on changes that a material does not show."""
    where = f"{source}: materials: {material.name!r}"
    if material.unlit:
        others = [key for key in changes if key != "base_color"]
        return [f"{where} is unlit: {', '.join(others)} without effect"] if others else []
    is_glossy = material.metallic or material.specular or material.transmission
    keys = [] if is_glossy else [key for key in changes if key in _WITH_GLOSS]
    if not keys:
        return []
    return [f"{where}: {', '.join(keys)} without effect, as it has no specular or metallic"]


def _with_changed(scene: model.Scene, changed: Mapping[int, model.Material]) -> model.Scene:
    materials = tuple(changed.get(id(material), material) for material in scene.materials)
    return dataclasses.replace(scene, materials=materials)


def _lit_properties(material: model.Material) -> tuple[Any, ...]:
    """Plain properties on which light depends; textures and arrays are left out."""
    if not (material.transmission or kind_of(material) & SurfaceKind.MIRROR):
        return material.base_color, material.alpha_mode, material.emissive
    values = (getattr(material, field.name) for field in dataclasses.fields(material))
    return tuple(value for value in values if not isinstance(value, model.Texture | np.ndarray))


# Dynamic objects of a scene's TOML file: their shapes and motions.


# Loader of an object's shape from a file, with an up axis and an animation.
LoadShape = Callable[[Path, str | None, str | None], model.Scene]


def load_object(
    table: scene_file.ObjectTable, folder: Path, load_shape: LoadShape, reader: SourceReader
) -> model.DynamicObject:
    """Load a dynamic object of a scene's TOML file, in whose folder its paths begin.

    Raises:
        SceneError: it is invalid; names object, key, actual and expected value.
    """
    where = f"object {table.name!r}"
    path = find_beside(folder, table.file, f"{where}: file", SceneError)
    # the name enters fingerprints, so it must not depend on this machine's paths
    shape = load_shape(path, table.up_axis, table.animation)
    shape = dataclasses.replace(shape, name=table.file)
    if shape.objects:
        raise SceneError(f"{where}: file = {table.file!r}: expected no [[objects]] in an object")
    try:
        motion = _motion(table, folder, reader)
    except TrajectoryError as reason:
        raise SceneError(f"{where}: {reason}") from None
    if table.rolling_radius_m is not None and not isinstance(motion, Rest):
        return model.DynamicObject(table.name, shape, Rolling(motion, table.rolling_radius_m))
    return model.DynamicObject(table.name, shape, motion)


def _motion(
    table: scene_file.ObjectTable, folder: Path, reader: SourceReader
) -> Along | Orbit | Shuttle | Rest:
    match table.motion:
        case None:
            return table.build(Rest if table.mass_kg is None else FreeBody)
        case scene_file.ObjectPathTable() as path:
            from omnisim.core.trajectories import Trajectory

            yaw_deg = path.yaw_deg or (0.0,) * len(path.times_s)
            for key, values in (("positions_m", path.positions_m), ("yaw_deg", yaw_deg)):
                if len(values) != len(path.times_s):
                    raise TrajectoryError(
                        f"path.{key}: expected {len(path.times_s)}, one for each of times_s, "
                        f"got {len(values)}"
                    )
            rotations = rotation_from_yaw(np.radians(yaw_deg))
            poses = pose_from_rotation(rotations, np.array(path.positions_m))
            return Along(Trajectory(np.array(path.times_s), poses), path.repeats)
        case scene_file.ObjectTrajectoryTable() as along:
            from omnisim.core.trajectories import read_trajectory

            return Along(read_trajectory(reader.note(folder / along.file)), along.repeats)
        case Orbit() | Shuttle() as motion:
            return motion
        case other:
            assert_never(other)


# Light and fog by the tables of a scene's TOML file.


# Contrast that remains at the visibility distance.
# Source: WMO, "Guide to Instruments and Methods of Observation", 2018, section 9.1.
_VISIBLE_CONTRAST = 0.05


def lit_scene(scene: model.Scene, settings: scene_file.SceneFile) -> model.Scene:
    """Scene with the light and fog of its TOML file.

    Lamps added to a base scene with a sky use the base scene's exposure.
    """
    table, lighting = settings.light, scene.lighting
    lamps = [_lamp(lamp) for lamp in settings.lamps]
    if settings.sun is not None:
        lamps += _sun(settings.sun)
    if lamps:
        lighting = _with_lamps(scene, tuple(lamps))
        if settings.extends is not None and scene.lighting.environment is not None:
            lighting = dataclasses.replace(lighting, exposure=scene.lighting.exposure)
    elif settings.sun is not None and is_even(lighting):
        lighting = dataclasses.replace(lighting, lights=(), ambient=FILL_AMBIENT)  # the sun is down
    if table.shadows is not None and not is_even(lighting):
        lighting = lighting.with_shadows(table.shadows)
    if table.ambient is not None:
        if not any(table.ambient) and is_even(lighting):
            lighting = dataclasses.replace(lighting, lights=())
        lighting = dataclasses.replace(lighting, ambient=table.ambient)
    if table.exposure is not None:
        if settings.extends is not None and lighting.environment is not None:
            lighting = dataclasses.replace(
                lighting,
                environment=lighting.environment.scaled(table.exposure / lighting.exposure),
            )
        lighting = dataclasses.replace(lighting, exposure=table.exposure)
    if (fog := settings.fog) is not None:
        others = {}
        if fog.visibility_m is not None:
            others["attenuation_per_m"] = (-math.log(_VISIBLE_CONTRAST) / fog.visibility_m,) * 3
        lighting = dataclasses.replace(lighting, fog=fog.build(model.Fog, **others))
    return scene if lighting is scene.lighting else dataclasses.replace(scene, lighting=lighting)


def _with_lamps(scene: model.Scene, lamps: tuple[model.Light, ...]) -> model.Lighting:
    """Lighting of a scene with additional lamps, which replace even light."""
    before = scene.lighting
    was_even = is_even(before)
    own = () if was_even else before.lights
    lit = scene if scene.instances else scene.at_start()  # if it has only dynamic objects
    exposed = expose((*own, *lamps), lit.meshes, lit.instances)
    ambient = exposed.ambient if was_even else before.ambient
    return dataclasses.replace(
        before, lights=exposed.lights, exposure=exposed.exposure, ambient=ambient
    )


def _lamp(table: LampTable) -> model.Light:
    others: dict[str, Any] = {"casts_shadow": table.shadows}
    if table.position_m is not None:
        others["position_m"] = np.array(table.position_m)
    if table.direction is not None:
        others["direction"] = np.array(table.direction) / np.linalg.norm(table.direction)
    if table.kind is model.LightKind.SPOT:
        inner = math.radians(table.inner_deg or 0.0)
        outer = math.radians(45.0 if table.outer_deg is None else table.outer_deg)
        others["cone_cosines"] = (math.cos(inner), math.cos(outer))
    return table.build(model.Light, **others)


def _sun(table: SunTable) -> list[model.Light]:
    """Sun as a list of one light, empty if it is below the horizon."""
    position = sun_position(table.time, table.latitude_deg, table.longitude_deg)
    if position.elevation_deg <= 0.0:
        return []
    level = table.illuminance_lx or sun_illuminance_lx(position.elevation_deg)
    return [
        table.build(
            model.Light,
            kind=model.LightKind.DIRECTIONAL,
            intensity=level,
            direction=position.direction(table.north_deg),
            casts_shadow=table.shadows,
        )
    ]
