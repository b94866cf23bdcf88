"""Formats that are not read: one line says how to convert the file."""

import ast
import itertools
import shlex

import pytest
import trimesh

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from omnisim.scene.formats.mesh.other_formats import CONVERSIONS

SUFFIXES = [suffix for conversion in CONVERSIONS for suffix in conversion.suffixes]


@pytest.mark.parametrize("conversion", CONVERSIONS, ids=lambda conversion: conversion.format)
def test_a_format_that_is_not_read_is_refused_with_the_way_to_convert_it(tmp_path, conversion):
    for suffix in conversion.suffixes:
        path = tmp_path / f"My Hall{suffix.upper()}"
        path.write_bytes(b"of another program")
        with pytest.raises(SceneError) as info:
            load_scene(path)
        message = str(info.value)
        assert message.startswith(f"{path}: is not read (")
        assert not {"\n", "{"} & set(message)
        assert not conversion.command or f"'{path}'" in message  # quoted, to be pasted
    for option, code in itertools.pairwise(shlex.split(conversion.command)):
        if option in ("-c", "--python-expr"):
            ast.parse(code)


def test_a_suffix_has_one_conversion_and_no_reader():
    assert len(SUFFIXES) == len(set(SUFFIXES))
    read = set(trimesh.available_formats()) - {"step", "stp"}  # read where cascadio is installed
    assert not {suffix[1:] for suffix in SUFFIXES} & read


def test_a_scene_file_of_such_a_mesh_and_a_world_of_xacro(tmp_path):
    (tmp_path / "a.fbx").write_bytes(b"Kaydara FBX Binary")
    (tmp_path / "a.toml").write_text('file = "a.fbx"\n')
    with pytest.raises(SceneError, match=r"a\.fbx: is not read \(FBX\): convert it to glTF with"):
        load_scene(tmp_path / "a.toml")
    (tmp_path / "a.sdf.xacro").write_bytes(b"<sdf/>")
    with pytest.raises(SceneError, match=r"expand it: xacro \S+a\.sdf\.xacro > \S+a\.sdf$"):
        load_scene(tmp_path / "a.sdf.xacro")
