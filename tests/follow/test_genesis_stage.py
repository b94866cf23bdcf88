"""Genesis: how its links move, in one world or many, and what is refused."""

import numpy as np
import pytest

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import OmnisimError, SceneError
from omnisim.follow import GenesisStage

LENS = EquidistantCamera(65, 65, 20.0, (32.0, 32.0), 1.6)


def test_a_missing_host_is_named(monkeypatch):
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: False)
    with pytest.raises(OmnisimError, match=r"omnisim.follow.GenesisStage needs genesis-world: pip"):
        GenesisStage(object())


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_ranges_and_worlds_are_those_of_genesis():
    genesis = pytest.importorskip("genesis", reason="Genesis is not installed")
    genesis.init(backend=genesis.cpu, logging_level="error")
    scene = genesis.Scene(show_viewer=False)
    scene.add_entity(genesis.morphs.Plane())
    box = scene.add_entity(genesis.morphs.Box(size=(0.4, 0.4, 0.4), pos=(2.0, 0.0, 0.7)))
    with pytest.raises(SceneError, match=r"call scene\.build"):
        GenesisStage(scene)
    scene.build(n_envs=2)
    for _ in range(10):
        scene.step()
    with GenesisStage(scene) as stage:
        heights = box.get_pos().cpu().numpy()[:, 2]
        states = stage.worlds_now()
        name = next(name for name in stage.names if "box" in name.lower())
        for state, height in zip(states, heights, strict=True):
            assert state.world_from_object[name][2, 3] == pytest.approx(height, abs=1e-6)
        camera = stage.open(LENS, omnisim.pose((0.0, 0.0, float(heights[0]))))
        ahead = camera.render(stage.now(), also=("range", "instance"))
        assert ahead.channels["range"][32, 32] == pytest.approx(1.8, abs=1e-3)
        assert stage.names[stage.body_ids(ahead)[32, 32]] == name
        down = stage.open(LENS, omnisim.pose((0.0, 0.0, 1.0), pitch_deg=90.0))
        below = down.render(stage.now(), also=("range",)).channels["range"][32, 32]
        assert below == pytest.approx(1.0, abs=1e-3)
        falls = stage.motion_now()(stage.now().time_s + 0.1).world_from_object[name][2, 3]
        speed = float(box.get_vel().cpu().numpy()[0, 2])
        assert falls == pytest.approx(heights[0] + 0.1 * speed, abs=1e-5)
        assert np.isfinite(speed)
        assert speed < 0.0
