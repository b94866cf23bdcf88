"""Named frames of a world or model, with poses relative to each other.

Source: SDFormat, pose frame semantics; https://github.com/gazebosim/sdformat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.poses import inverse
from omnisim.scene.formats.xml.element import XmlElement

_OWN = frozenset(("", "__model__", "world", "__root__"))


class _Frame(NamedTuple):
    """Frame in a scope.

    Attributes:
        element: element with the frame's pose.
        default: reference frame if the pose names none.
        inner: scope of a nested model; None: not a model.
        placement: frame of the inner scope to which the pose applies; empty: the model's own frame.
    """

    element: XmlElement
    default: str
    inner: Scope | None
    placement: str


class UnplacedError(SceneError):
    """Error for a pose relative to a missing model."""


class Scope:
    """Named frames of the world or of a model; the empty name is its own frame."""

    def __init__(self) -> None:
        self._frames: dict[str, _Frame] = {}
        self._missing: set[str] = set()
        self._poses: dict[str, NDArray[np.float64]] = {}
        self._aliases: dict[str, str] = {}
        self._active: list[str] = []

    def add(self, name: str, element: XmlElement, default: str = "") -> None:
        """Add a link, frame or joint, unless the name exists.

        Args:
            name: name of the frame.
            element: element with the frame's pose.
            default: reference frame if the pose names none.
        """
        self._frames.setdefault(name, _Frame(element, default, None, ""))

    def add_model(self, name: str, element: XmlElement, inner: Scope, placement: str = "") -> None:
        """Add a nested model.

        Args:
            name: name of the model.
            element: `<include>` or `<model>` with the pose.
            inner: frames of the model.
            placement: frame of the model to which the pose applies; empty: the model's own frame.
        """
        self._frames.setdefault(name, _Frame(element, "", inner, placement))

    def add_missing(self, name: str) -> None:
        """Add a missing nested model; poses relative to it are undefined."""
        self._missing.add(name)

    def add_alias(self, name: str, frame: str) -> None:
        """Make a frame of a merged model accessible by its own name."""
        self._aliases.setdefault(name, frame)

    def place(self, name: str, scope_from_frame: NDArray[np.float64]) -> None:
        """Override the pose of a link or model from the file."""
        self._poses[name] = scope_from_frame

    def pose_of(self, element: XmlElement, default: str = "") -> NDArray[np.float64]:
        """Pose (4, 4) scope_from_element.

        Args:
            element: element with the pose.
            default: reference frame if the pose names none.

        Raises:
            UnplacedError: a pose relative to a missing model.
            SceneError: an unknown frame, or a frame relative to itself.
        """
        pose: NDArray[np.float64] = (
            self._scope_from(element.relative_to or default, element) @ element.pose()
        )
        return pose

    def model_pose(self, name: str) -> NDArray[np.float64]:
        """Pose (4, 4) scope_from_model of a nested model."""
        return self._scope_from(name, self._frames[name].element)

    def _scope_from(self, name: str, element: XmlElement) -> NDArray[np.float64]:
        if name in self._poses:
            return self._poses[name]
        frame = self._frames.get(name)
        if frame is None:
            return self._outside(name, element)
        if name in self._active:
            circle = " → ".join((*self._active[self._active.index(name) :], name))
            raise element.error("frames that are not relative to themselves", circle)
        self._active.append(name)
        pose = self.pose_of(frame.element, frame.default)
        if frame.inner is not None and frame.placement:
            pose = pose @ inverse(frame.inner._scope_from(frame.placement, frame.element))
        self._active.pop()
        self._poses[name] = pose
        return pose

    def _outside(self, name: str, element: XmlElement) -> NDArray[np.float64]:
        """Pose (4, 4) of the scope itself, or of a frame `model::frame` in a nested model."""
        if name in _OWN:
            return np.eye(4)
        name = self._aliases.get(name, name)
        outer, separator, rest = name.partition("::")
        frame = self._frames.get(outer)
        if frame is None and outer in self._missing:
            raise UnplacedError(f"{element.place}: its pose is relative to {outer!r}, not found")
        if not separator or frame is None or frame.inner is None:
            hint = did_you_mean(name, self._frames, "there are")
            raise element.error(f"the name of a frame; {hint}", name)
        inner = frame.inner._scope_from(rest, element)
        pose: NDArray[np.float64] = self._scope_from(outer, element) @ inner
        return pose
