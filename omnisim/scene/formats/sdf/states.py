"""State of a world: saved poses, from which Gazebo Classic restores its models."""

from __future__ import annotations

from omnisim.core.poses import inverse
from omnisim.scene.formats.omissions import Omissions
from omnisim.scene.formats.sdf.models import Model, with_pose_of
from omnisim.scene.formats.xml.element import XmlElement

_UNIT = (1.0, 1.0, 1.0)


def apply_state(world: Model, omissions: Omissions) -> None:
    """Move models, links and lights to their saved poses, which are in the world frame.

    Raises:
        SceneError: invalid values.
    """
    state = world.element.find("state")
    if state is None:
        return
    _move(world, state, omissions)
    lights = {light.name: light for light in state.children("light")}
    world.others[:] = [with_pose_of(one, lights.get(one.name, one)) for one in world.others]
    for _ in state.children("insertions"):
        omissions.count("insertions of a state are not made", "state")


def _move(outer: Model, state: XmlElement, omissions: Omissions) -> None:
    """Move the models and links of the world or of a model.

    Args:
        outer: the world, or a model that is already moved.
        state: saved state of `outer`.
        omissions: counts of saved values that are not applied.
    """
    world_from_outer = state.pose()
    models = {model.name: model for model in outer.models}
    for saved in state.children("model", "link"):
        is_model = saved.element.tag == "model"
        if saved.find("pose") is not None and (saved.name in models or not is_model):
            outer.scope.place(saved.name, inverse(world_from_outer) @ saved.pose())
        if is_model and saved.name in models:
            if saved.vector("scale", _UNIT) != _UNIT:
                omissions.count("scales of a state are not applied", "model")
            _move(models[saved.name], saved, omissions)
