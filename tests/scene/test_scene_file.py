import numpy as np
import pytest
import trimesh

from omnisim.errors import SceneError
from omnisim.scene import load_scene


@pytest.fixture
def folder(tmp_path):
    trimesh.creation.box(extents=(100.0, 200.0, 300.0)).export(tmp_path / "box.stl")
    return tmp_path


def test_scene_file_says_what_the_mesh_cannot(folder):
    path = folder / "scene.toml"
    path.write_text(
        'file = "box.stl"\nup_axis = "y"\nmeters_per_unit = 0.01\nbackground = [0, 0, 0]\n'
        "[start]\nposition_m = [0.1, 0.2, 0.3]\nyaw_deg = 90\n"
    )
    scene = load_scene(path)
    low, high = scene.bounds_m()
    np.testing.assert_allclose(high - low, (1.0, 3.0, 2.0), atol=1e-6)
    assert scene.background == (0.0, 0.0, 0.0)
    assert scene.start.position_m == (0.1, 0.2, 0.3)
    assert load_scene(folder).start.yaw_deg == 90.0  # the folder stands for its scene.toml


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"scene\.toml: file: missing"),
        ('file = "gone.stl"', r"scene\.toml: file = 'gone\.stl': no such file"),
        ('file = "box.stl"\nup = "y"', r"up: unknown key; did you mean 'up_axis'"),
        ('file = "box.stl"\nup_axis = "w"', r"up_axis = 'w': want"),
        ('file = "box.stl"\nmeters_per_unit = "1"', r"meters_per_unit = '1': want a valid number"),
        ('file = "box.stl"\nmeters_per_unit = 0', r"meters_per_unit = 0: want greater than 0"),
        ('file = "box.stl"\n[start]\nposition_m = [1, 2]', r"start\.position_m"),
        ('file = "box.stl"\nbackground = [-1, 0, 0]', r"background\.0 = -1: want"),
        ("file = ", r"scene\.toml: not TOML"),
    ],
)
def test_bad_scene_files_name_file_key_and_value(folder, text, words):
    path = folder / "scene.toml"
    path.write_text(text)
    with pytest.raises(SceneError, match=words):
        load_scene(path)
