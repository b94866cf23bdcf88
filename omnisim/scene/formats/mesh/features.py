"""Features of OBJ, MTL, PLY, STL, OFF and COLLADA, and the parts of such files."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np

from omnisim.scene.formats.features import Feature, Support, part_notices, xml_parts
from omnisim.scene.formats.mesh.obj_text import decode_text

_APPLIED, _LEFT_OUT, _IGNORED = Support.APPLIED, Support.LEFT_OUT, Support.IGNORED
_WORDS = re.compile(r"^[ \t]*([A-Za-z_]+\w*)(?:[ \t]+([^\n]*))?", re.MULTILINE)


def _is_nonzero(text: str) -> bool:
    """True for numbers other than 0, and for words that are no numbers, such as file names."""
    return any(word.strip("0.-+") for word in str(text).split())


def _is_not_one(text: str) -> bool:
    return any(word.rstrip("0").rstrip(".") != "1" for word in str(text).split())


def _is_smooth(text: str) -> bool:
    return str(text).strip() not in ("off", "0", "")


_SPLAT = "a Gaussian splat: its points have no surface"
OBJ_FEATURES = (
    Feature("v, vt, vn, f", _APPLIED, "polygons as triangles; colors of vertices"),
    Feature("o, g", _APPLIED, "an instance each, by names such as `chair` or `chair/legs`"),
    Feature("usemtl, mtllib", _APPLIED, "a mesh a material"),
    Feature("s", _LEFT_OUT, "smoothing groups are not used: without normals surfaces are flat", "group", _is_smooth),
    Feature("p, l", _LEFT_OUT, "points and lines are not drawn", "element"),
    Feature("vp, cstype, deg, bmat, step, curv, curv2, surf, parm, trim, hole, scrv, sp, end, con", _LEFT_OUT, "curves and free-form surfaces are not drawn", "line"),
    Feature("usemap, maplib", _LEFT_OUT, "maps of OBJ itself are not drawn", "line"),
    Feature("mg, bevel, c_interp, d_interp, lod, shadow_obj, trace_obj, ctech, stech", _IGNORED, "of free-form surfaces, or of other renderers"),
)  # fmt: skip
MTL_FEATURES = (
    Feature("newmtl, kd, map_kd, map_kd-s, map_kd-o", _APPLIED, "sRGB; the map with scale and offset"),
    Feature("d, tr, map_d", _APPLIED, "opacity, `Tr` is 1 − `d`; invisible materials are noted"),
    Feature("bump, map_bump, norm", _LEFT_OUT, "bump and normal maps are not drawn", "material"),
    Feature("disp, decal, refl, map_refl", _LEFT_OUT, "displacement, decals and reflection maps are not drawn", "material"),
    Feature("ks, map_ks, map_ns", _LEFT_OUT, "highlights are not drawn: surfaces are matte", "material", _is_nonzero),
    Feature("ke, map_ke", _LEFT_OUT, "emission is not drawn", "material", _is_nonzero),
    Feature("pr, pm, ps, pc, pcr, aniso, anisor, map_pr, map_pm, map_ps, map_rma, map_orm", _LEFT_OUT, "metal, roughness and the other keys of PBR are not drawn", "material", _is_nonzero),
    Feature("tf", _LEFT_OUT, "colors of transmission are not drawn", "material", _is_not_one),
    Feature("map_kd-clamp, map_kd-mm, map_kd-t, map_kd-imfchan, map_d-s, map_d-o", _LEFT_OUT, "options of maps other than scale and offset of the color are not used", "map"),
    Feature("ka, map_ka, ns, ni, illum, sharpness, map_aat, map_kd-bm, map_kd-blendu, map_kd-blendv, map_kd-boost, map_kd-cc, map_kd-texres, map_kd-type, map_kd-colorspace", _IGNORED, "they change matte surfaces little or not at all"),
)  # fmt: skip
PLY_FEATURES = (
    Feature("vertex.x, vertex.y, vertex.z, face.vertex_index, face.vertex_indices", _APPLIED, "polygons as triangles"),
    Feature("vertex.nx, vertex.ny, vertex.nz", _APPLIED, "smooth shading; flat without them"),
    Feature("vertex.red, vertex.green, vertex.blue, vertex.alpha, face.red, face.green, face.blue, face.alpha", _APPLIED, "sRGB"),
    Feature("vertex.s, vertex.t, vertex.u, vertex.v, vertex.texture_u, vertex.texture_v, face.texcoord, TextureFile", _APPLIED, "one texture"),
    Feature("face.texnumber", _LEFT_OUT, "textures beyond the first are not drawn", "property"),
    Feature("vertex.diffuse_red, vertex.r, vertex.f_dc_0", _LEFT_OUT, "colors under other names than red, green and blue are not drawn", "property"),
    Feature("tristrips, tristrips.vertex_indices", _LEFT_OUT, "strips are not drawn", "property"),
    Feature("edge.vertex1, edge.vertex2", _LEFT_OUT, "points and lines are not drawn", "property"),
    Feature("vertex.quality, vertex.intensity, vertex.confidence, vertex.flags, vertex.radius, vertex.value, vertex.scalar_intensity, face.flags, face.quality, face.texture_id, edge.red, edge.green, edge.blue, vertex.diffuse_green, vertex.diffuse_blue, vertex.g, vertex.b, vertex.material_index, face.nx, face.ny, face.nz", _IGNORED, "scalars, or told already"),
)  # fmt: skip
STL_FEATURES = (
    Feature("triangles", _APPLIED, "flat; normals follow from the corners"),
    Feature("attributes, COLOR", _LEFT_OUT, "colors of STL are not drawn", "triangle"),
)
OFF_FEATURES = (
    Feature("OFF", _APPLIED, "polygons as triangles"),
    Feature("C, face colors", _LEFT_OUT, "colors of OFF are not drawn", "file"),
    Feature("N", _LEFT_OUT, "normals of OFF are not used: surfaces are flat", "file"),
    Feature("ST", _IGNORED, "texture coordinates, without a texture"),
)
COLLADA_FEATURES = (
    Feature("asset, unit, up_axis, asset/*", _APPLIED, "without `up_axis`: y, with a note; as a mesh of URDF and SDF it is not turned"),
    Feature("library_geometries, geometry, mesh, source, float_array, technique_common, accessor, param, vertices, input, p, vcount, h, ph", _APPLIED, "positions, normals, colors, the first texture coordinates"),
    Feature("triangles, polylist, polygons", _APPLIED, "polygons as triangles"),
    Feature("tristrips, trifans", _LEFT_OUT, "strips and fans are not drawn", "element"),
    Feature("lines, linestrips, spline", _LEFT_OUT, "points and lines are not drawn", "element"),
    Feature("convex_mesh, brep", _LEFT_OUT, "convex meshes and boundaries are not drawn", "element"),
    Feature("library_visual_scenes, visual_scene, library_nodes, node, matrix, translate, rotate, scale, instance_geometry, instance_node, bind_material, instance_material, bind, bind_vertex_input, scene, instance_visual_scene", _APPLIED, "an instance a node"),
    Feature("skew, lookat", _LEFT_OUT, "skewed and looking nodes are placed without it", "node"),
    Feature("library_materials, material, instance_effect, library_effects, effect, profile_COMMON, newparam, surface, sampler2D, source, technique, phong, lambert, blinn, constant, diffuse, color, texture, transparent, library_images, image, init_from, double_sided, float", _APPLIED, "diffuse color or texture (sRGB), and the alpha of `transparent`"),
    Feature("emission", _LEFT_OUT, "emission is not drawn", "material", lambda one: _is_lit(one)),
    Feature("specular, reflective", _LEFT_OUT, "highlights are not drawn: surfaces are matte", "material", lambda one: _is_lit(one)),
    Feature("bump", _LEFT_OUT, "bump and normal maps are not drawn", "material"),
    Feature("transparency", _LEFT_OUT, "`transparency` is not applied", "material", lambda one: _is_not_one(" ".join(one.itertext()))),
    Feature("instance_controller", _LEFT_OUT, "skins and morphs are not drawn", "node"),
    Feature("instance_light", _LEFT_OUT, "lights are not read", "light"),
    Feature("instance_camera", _LEFT_OUT, "cameras are not read", "camera"),
    Feature("animation", _LEFT_OUT, "animations are not played", "animation"),
    Feature("extra", _APPLIED, "of effects: looked through for bump maps"),
    Feature("library_lights, library_cameras, library_controllers, library_animation_clips, library_physics_models, library_physics_materials, library_physics_scenes, library_kinematics_models, library_joints, library_articulated_systems, library_kinematics_scenes, instance_physics_scene, instance_kinematics_scene, ambient, shininess, reflectivity, index_of_refraction, Name_array, bool_array, int_array, IDREF_array, wrapS, wrapT, minfilter, magfilter, mipfilter, format", _IGNORED, "they show nothing, or nodes tell it"),
    Feature("library_animations", _APPLIED, "looked through for animations"),
    Feature("@*", _IGNORED, "names and references"),
)  # fmt: skip


def _is_lit(element: Any) -> bool:
    """True for a color above 0 or a texture."""
    colors = " ".join(one.text or "" for one in element if one.tag.endswith("color")).split()[:3]
    return any(one.tag.endswith("texture") for one in element) or _is_nonzero(" ".join(colors))


def mesh_notices(kind: str, data: bytes) -> list[str]:
    """Notices for parts of a file that are left out or unknown.

    Args:
        kind: suffix without its dot, or "mtl".
        data: content of the file; of MTL in its normalized form.
    """
    if kind not in _TABLES or (kind == "mtl" and b"newmtl" not in data):
        return []
    features, find = _TABLES[kind]
    return part_notices(features, find(data))


def _text_parts(data: bytes) -> Iterator[tuple[str, str]]:
    """First words of the lines; vertices and faces, the many, are not looked at."""
    text = re.sub(r"#[^\n]*", "", decode_text(data))
    text = re.sub(r"^[ \t]*(v|vt|vn|f)[ \t][^\n]*$", "", text, flags=re.MULTILINE)
    has_normals = re.search(rb"^[ \t]*vn[ \t]", data, re.MULTILINE) is not None
    for match in _WORDS.finditer(text):
        if not (has_normals and match[1] == "s"):
            yield match[1], match[2] or ""


def _mtl_parts(data: bytes) -> Iterator[tuple[str, str]]:
    """Keys in lower case, each once a material."""
    seen: set[str] = set()
    for line in decode_text(data).split("\n"):
        key, _, value = line.partition(" ")
        key = key.lower()
        seen = set() if key == "newmtl" else seen
        if key and key not in seen:
            seen.add(key)
            yield key, value


def _ply_parts(data: bytes) -> Iterator[tuple[str, str]]:
    element = ""
    for line in data.partition(b"end_header")[0].decode("latin-1").split("\n"):
        words = line.split()
        if words[:1] == ["element"] and len(words) > 1:
            element = words[1]
        elif words[:1] == ["property"]:
            yield f"{element}.{words[-1]}", line


def _stl_parts(data: bytes) -> Iterator[tuple[str, str]]:
    is_text = data.lstrip().startswith(b"solid") and b"endsolid" in data
    if is_text or (len(data) - 84) % 50:
        return
    triangles = np.frombuffer(data, np.uint8, offset=84).reshape(-1, 50)
    for _ in range(int(triangles[:, 48:].any(axis=1).sum())):
        yield "attributes", ""
    if b"COLOR=" in data[:80]:
        yield "COLOR", ""


def _off_parts(data: bytes) -> Iterator[tuple[str, str]]:
    lines = [line for line in decode_text(data).split("\n") if line.partition("#")[0].strip()]
    head = re.match(r"\s*(ST)?(C)?(N)?(4?n?OFF)", lines[0]) if lines else None
    yield from ((name, "") for name in (head.groups() if head else ()) if name)
    last = lines[-1].split() if lines else []
    if last and last[0].isdigit() and len(last) > int(last[0]) + 2:
        yield "face colors", ""


def _collada_parts(data: bytes) -> Iterator[tuple[str, Any]]:
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError):
        return
    yield from xml_parts(root, COLLADA_FEATURES)


_TABLES: dict[str, tuple[tuple[Feature, ...], Callable[[bytes], Iterator[tuple[str, Any]]]]] = {
    "obj": (OBJ_FEATURES, _text_parts), "mtl": (MTL_FEATURES, _mtl_parts),
    "ply": (PLY_FEATURES, _ply_parts), "stl": (STL_FEATURES, _stl_parts),
    "off": (OFF_FEATURES, _off_parts), "dae": (COLLADA_FEATURES, _collada_parts),
}  # fmt: skip
