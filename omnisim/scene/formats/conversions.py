"""Formats that omnisim cannot read, with a conversion for each."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

_EXPANDED = (".sdf", ".world", ".urdf", ".xml")  # suffixes before .xacro
SOURCE, TARGET = "{source}", "{target}"  # placeholders in a conversion's command


@dataclass(frozen=True)
class Conversion:
    """Conversion of a format to one that omnisim can read.

    Attributes:
        suffixes: suffixes of the format's files, lower case.
        format: format name.
        advice: sentence that explains the conversion.
        command: shell command with `{source}` and `{target}` for the two files; empty: no command.
        target_suffix: suffix of the file that the command writes.
    """

    suffixes: tuple[str, ...]
    format: str
    advice: str
    command: str = ""
    target_suffix: str = ".glb"

    def command_for(self, source: Path) -> str:
        """Command that converts a file and writes the result next to it."""
        target = source.with_suffix("")  # robot.urdf.xacro becomes robot.urdf
        if target.suffix.lower() not in _EXPANDED:
            target = source.with_suffix(self.target_suffix)
        command = self.command.replace(SOURCE, shlex.quote(str(source)))
        return command.replace(TARGET, shlex.quote(str(target)))


def _blender(operator: str) -> str:
    """Command that imports a file into an empty Blender scene and exports the whole scene."""
    return (
        'blender -b --python-expr "import bpy, sys; '
        "bpy.ops.wm.read_factory_settings(use_empty=True); "
        f"{operator}(filepath=sys.argv[-2]); "
        f'bpy.ops.export_scene.gltf(filepath=sys.argv[-1], export_lights=True)" -- '
        f"{SOURCE} {TARGET}"
    )


_BLENDER = "convert it to glTF with Blender"
_ASSIMP = f"assimp export {SOURCE} {TARGET} -fglb2"
CONVERSIONS = (
    Conversion(
        (".blend",),
        "Blender",
        _BLENDER,
        f'blender -b {SOURCE} --python-expr "import bpy, sys; '
        f'bpy.ops.export_scene.gltf(filepath=sys.argv[-1], export_lights=True)" -- {TARGET}',
    ),
    Conversion((".fbx",), "FBX", _BLENDER, _blender("bpy.ops.import_scene.fbx")),
    Conversion((".abc",), "Alembic", _BLENDER, _blender("bpy.ops.wm.alembic_import")),
    Conversion(
        (".3ds", ".ase", ".lwo", ".ms3d", ".x", ".x3d", ".wrl"),
        "an older exchange format",
        "convert it to glTF with Assimp",
        _ASSIMP,
    ),
    Conversion((".max",), "3ds Max", "export it from 3ds Max as glTF"),
    Conversion((".ma", ".mb"), "Maya", "export it from Maya as FBX, and that with Blender as glTF"),
    Conversion((".c4d",), "Cinema 4D", "export it from Cinema 4D as glTF"),
    Conversion((".skp",), "SketchUp", "export it from SketchUp as glTF"),
    Conversion((".umap", ".uasset"), "Unreal", "export it with Unreal Editor's glTF exporter"),
    Conversion((".xacro",), "xacro", "expand it", f"xacro {SOURCE} > {TARGET}", ".urdf"),
    Conversion(
        (".step", ".stp"),
        "STEP",
        "convert it to glTF with cascadio",
        f'python -c "import sys, cascadio; cascadio.step_to_glb(*sys.argv[1:])" {SOURCE} {TARGET}',
    ),
    Conversion((".iges", ".igs", ".brep", ".fcstd"), "CAD", "export it from FreeCAD as glTF"),
    Conversion((".ifc",), "IFC", "convert it to glTF", f"IfcConvert {SOURCE} {TARGET}"),
    Conversion(
        (".las", ".laz", ".pcd", ".e57", ".pts"),
        "a point cloud without surfaces",
        "make a mesh of it, with CloudCompare or Open3D, and save that as PLY",
    ),
)
_BY_SUFFIX = {suffix: found for found in CONVERSIONS for suffix in found.suffixes}


def conversion_hint(path: Path) -> str:
    """One-line hint on how to convert a file; empty for an unknown suffix."""
    conversion = _BY_SUFFIX.get(path.suffix.lower())
    if conversion is None:
        return ""
    hint = f"is not read ({conversion.format}): {conversion.advice}"
    return f"{hint}: {conversion.command_for(path)}" if conversion.command else hint
