"""Body of a robot whose model includes its own world."""

from __future__ import annotations

from pathlib import Path

from omnisim.scene.formats.mjcf.names import geom_names
from omnisim.scene.formats.mjcf.reader import load_model
from omnisim.scene.model import Scene

_WORLD = 0


def without_world(scene: Scene, path: Path) -> Scene:
    """Scene of a model without the world's own geoms, usually a floor, if bodies have any geoms.

    Args:
        scene: scene of the model.
        path: path of the model file.

    Raises:
        SceneError: MuJoCo cannot read the file.
    """
    model, _, _ = load_model(path)
    owners = dict(zip(geom_names(model), model.geom_bodyid.tolist(), strict=True))
    of_world = [name for name in scene.instance_names if owners.get(name) == _WORLD]
    if len(of_world) < len(scene.instance_names):
        for name in of_world:
            scene = scene.removed(name)
    return scene
