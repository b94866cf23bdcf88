import numpy as np
import pytest
import trimesh

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene

PLACES = """file = "box.stl"
[[starts]]
name = "dock"
position_m = [1, 2.5, 0]
yaw_deg = 90
[[starts]]
name = "door"
position_m = [0, 0, 0]
[palette]
white = [0.9, 0.9, 0.9]
red = [0.8, 0, 0]
[[landmarks]]
name = "pole"
position_m = [3, -2, 0]
footprint_m = [0.1, 0.2]
bands = [{ color = "white", top_m = 0.25 }, { color = "red", top_m = 1.5 }]
"""


@pytest.fixture
def folder(tmp_path):
    trimesh.creation.box(extents=(100.0, 200.0, 300.0)).export(tmp_path / "box.stl")
    return tmp_path


def test_scene_file_overrides_the_mesh_file(folder):
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


def test_scene_file_lists_starts_and_landmarks(folder):
    path = folder / "scene.toml"
    path.write_text(PLACES)
    scene = load_scene(path)
    dock, door = scene.starts
    assert (dock.name, dock.position_m, dock.yaw_deg) == ("dock", (1.0, 2.5, 0.0), 90.0)
    assert (door.name, door.yaw_deg) == ("door", 0.0)
    (pole,) = scene.landmarks
    assert (pole.name, pole.position_m) == ("pole", (3.0, -2.0, 0.0))
    assert pole.footprint_m == (0.1, 0.2)
    assert [(band.color, band.bottom_m, band.top_m) for band in pole.bands] == [
        ("white", 0.0, 0.25),
        ("red", 0.25, 1.5),
    ]
    assert pole.bands[1].linear_rgb == (0.8, 0.0, 0.0)
    assert pole.height_m == 1.5


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"door"', '"dock"', r"scene\.toml: starts: name = 'dock': expected each name once$"),
        ('"door"', "7", r"starts\.1\.name: expected text, got 7$"),
        ('"door"', '""', r"starts\.1\.name: expected at least 1 character, got ''$"),
        ("yaw_deg", "yaw", r"starts\.0\.yaw: unknown key; did you mean 'yaw_deg'\?$"),
        ("red =", "rod =", r"pole: color = 'red': unknown; did you mean 'rod'"),
        ("0.8, 0, 0", "0.8, 0", r"palette\.red"),
        ("[0.1, 0.2]", "[0.1, 0]", r"landmarks\.0\.footprint_m\.1: expected a number > 0, got 0$"),
        ("top_m = 1.5", "top_m = 0.2", r"\.0: top_m: expected more than 0\.25 below it, got 0\.2$"),
        ("top_m = 1.5", "height = 1.5", r"bands\.1\.height: unknown key; known keys: color, top_m"),
    ],
)
def test_faults_of_starts_and_landmarks_name_key_and_value(folder, old, new, words):
    path = folder / "scene.toml"
    path.write_text(PLACES.replace(old, new))
    with pytest.raises(SceneError, match=words):
        load_scene(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"scene\.toml: file: missing"),
        ('file = "gone.stl"', r"scene\.toml: file = 'gone\.stl': no such file"),
        ('file = "box.stl"\nup = "y"', r"up: unknown key; did you mean 'up_axis'"),
        ('file = "box.stl"\nup_axis = "w"', "up_axis: expected.*, got 'w'"),
        (
            'file = "box.stl"\nmeters_per_unit = "1"',
            "meters_per_unit: expected a number.*, got '1'",
        ),
        (
            'file = "box.stl"\nmeters_per_unit = 0',
            "meters_per_unit: expected a number > 0.*, got 0",
        ),
        ('file = "box.stl"\n[start]\nposition_m = [1, 2]', r"start\.position_m"),
        (
            'file = "box.stl"\n[starts]\nname = "a"',
            r"starts: expected tables, \[\[starts\]\], got \{",
        ),
        ('file = "box.stl"\nbackground = [-1, 0, 0]', r"background\.0: expected.*, got -1"),
        ("file = ", r"scene\.toml: not TOML"),
    ],
)
def test_bad_scene_files_name_file_key_and_value(folder, text, words):
    path = folder / "scene.toml"
    path.write_text(text)
    with pytest.raises(SceneError, match=words):
        load_scene(path)


@pytest.mark.parametrize(
    ("waypoints", "words"),
    [
        ("[[0, 0]]", r": expected at least 2 items, got \[\[0, 0\]\]$"),
        ("[[0, 0], [nan, 0]]", r"\.1\.0: expected a finite number, got nan$"),
        ("[[0, 0], [1, 0, 0]]", r"\.1: expected at most 2 items, got \[1, 0, 0\]$"),
        ('[[0, 0], [1, "1"]]', r"\.1\.1: expected a number, got '1'$"),
    ],
)
def test_bad_waypoints_get_one_line(folder, waypoints, words):
    path = folder / "scene.toml"
    path.write_text(f'file = "box.stl"\n[[paths]]\nname = "a"\nwaypoints_m = {waypoints}')
    with pytest.raises(SceneError, match=rf"scene\.toml: paths\.0\.waypoints_m{words}") as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)
