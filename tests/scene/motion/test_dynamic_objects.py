"""`[[objects]]` and `extends` of a scene's TOML: what they give, and one line for what is wrong."""

import numpy as np
import pytest
import trimesh

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene

FLOOR, SOCCER = 'file = "floor.glb"\n', 'extends = "soccer"\n'
BALL = '[[objects]]\nname = "ball"\nfile = "ball.glb"\n'


@pytest.fixture
def folder(tmp_path):
    trimesh.creation.icosphere(1, 0.2).export(tmp_path / "ball.glb")
    trimesh.creation.box((4.0, 4.0, 0.1)).export(tmp_path / "floor.glb")
    (tmp_path / "a.tum").write_text("0 0 0 0 0 0 0 1\n2 4 0 0 0 0 0 1\n")
    return tmp_path


def load(folder, text, head=FLOOR):
    (folder / "scene.toml").write_text(head + text)
    return load_scene(folder)


@pytest.mark.parametrize(
    ("motion", "at_1_s"),
    [
        ("position_m = [1, 2, 3]\n", (1, 2, 3)),
        ("position_m = [1, 2, 3]\nmass_kg = 0.4\n", (1, 2, 3)),
        ("", (0, 0, 0)),
        ("path = { times_s = [0, 2], positions_m = [[0, 0, 1], [4, 2, 1]] }\n", (2, 1, 1)),
        ('trajectory = { file = "a.tum" }\n', (2, 0, 0)),
        ("orbit = { center_m = [0, 0, 1], radius_m = 2, period_s = 4 }\n", (0, 2, 1)),
        ("shuttle = { from_m = [0, 0, 0], to_m = [3, 0, 0], period_s = 2 }\n", (3, 0, 0)),
    ],
)
def test_motions(folder, motion, at_1_s):
    (ball,) = load(folder, BALL + motion).objects
    np.testing.assert_allclose(ball.motion.pose_at(1.0)[:3, 3], at_1_s, atol=1e-12)
    assert (ball.name, ball.shape.triangle_count) == ("ball", 80)


def test_a_scene_extends_another(folder):
    start = '[[starts]]\nname = "mine"\nposition_m = [0, 0, 0]\n'
    scene, soccer = load(folder, start + BALL, 'extends = "soccer"\n'), load_scene("soccer")
    assert scene.triangle_count == soccer.triangle_count
    assert [one.name for one in scene.starts] == [*(one.name for one in soccer.starts), "mine"]
    assert (scene.start, scene.background) == (soccer.start, soccer.background)
    (folder / "second.toml").write_text(f'extends = "scene.toml"\n{BALL.replace("ball", "b", 1)}')
    second = load_scene(folder / "second.toml")
    assert [moving.name for moving in second.objects] == ["ball", "b"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BALL + BALL, "objects: name = 'ball': expected each name once"),
        (BALL.replace("ball.glb", "none.glb"), "object 'ball': file = 'none.glb': no such file"),
        (BALL.replace("ball.glb", "b" * 500), "bbb': cannot be read: File name too long"),
        (BALL + "yaw_deg = 3\nshuttle = { from_m = [0,0,0], to_m = [1,0,0], period_s = 1 }\n",
         "expected position_m and yaw_deg without a motion, got shuttle"),
        (BALL + "rolling_radius_m = 1\n", "rolling_radius_m: requires a motion"),
        (
            BALL + "mass_kg = 1\norbit = { center_m = [0, 0, 1], radius_m = 2, period_s = 4 }\n",
            "mass_kg: expected no motion, got orbit",
        ),
        (BALL + "orbit = { center_m = [0,0,0], radius_m = 1, period_s = 0 }\n",
         "period_s: expected a number other than 0"),
        (BALL + 'trajectory = { file = "b.tum" }\n', "object 'ball': .*b.tum: cannot be read"),
        (BALL + "path = { times_s = [0, 1], positions_m = [[0, 0, 0]] }\n",
         "path.positions_m: expected 2, one for each of times_s, got 1"),
        (BALL + "path = { times_s = [1, 1], positions_m = [[0, 0, 0], [1, 0, 0]] }\n",
         "object 'ball': trajectory: time 1, 1 s, is not after"),
        (BALL.replace("ball.glb", "scene.toml"), "extends itself, or has itself as an object"),
        (SOCCER + FLOOR, "expected either file or extends, got both"),
        ('extends = "scene.toml"\n', "extends itself"),
        ('extends = "socer"\n', "did you mean 'soccer'"),
        (SOCCER + 'up_axis = "z"\n', "expected no up_axis"),
        (SOCCER + '[[starts]]\nname = "kick_off"\nposition_m = [0, 0, 0]\n',
         "starts: name = 'kick_off': the scene that it extends already has one"),
    ],
)  # fmt: skip
def test_faulty_objects_and_extensions(folder, text, words):
    with pytest.raises(SceneError, match=words) as caught:
        load(folder, text, "" if text.startswith("extends") else FLOOR)
    assert "\n" not in str(caught.value)
