"""Renderers that race in a scene, and the reasons why some are missing."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial

from benchmarks.peers.embree import EmbreeColors, EmbreeGeometry
from benchmarks.peers.gazebo import GazeboWay
from benchmarks.peers.ours import Omnisim
from benchmarks.peers.paper import PaperWay
from benchmarks.peers.peer import SENSOR, ImagePeer, Peer
from benchmarks.peers.pyrender_faces import PyrenderFaces
from benchmarks.settings import at_setting
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.shared_scene import Closeable
from omnisim.rendering.stage import Stage
from omnisim.validation.oracles import import_failure

FAST, DEFAULT = "omnisim, fast", "omnisim, default"
PYRENDER, PYRENDER_FLAT, UNLIT = "pyrender", "pyrender, flat", "omnisim, fast, unlit"
PAPER, GAZEBO = PaperWay.name, GazeboWay.name
EMBREE, EMBREE_COLOR = EmbreeGeometry.name, EmbreeColors.name
# omnisim at other settings: texels per side of the image's finest pixels, with 2 × 2 samples.
BETWEEN = {f"omnisim, {texels:g} texels": texels for texels in (0.45, 0.6, 0.8, 1.3, 1.7)}
# From the fastest to the best setting.
LADDER = (*list(BETWEEN)[:3], FAST, *list(BETWEEN)[3:], DEFAULT)
NAMES = (*LADDER, UNLIT, PYRENDER, PYRENDER_FLAT, PAPER, GAZEBO, EMBREE, EMBREE_COLOR)


def rung(name: str) -> OmniCamera:
    """Camera of omnisim at a quality setting, a key of `LADDER`."""
    if name in BETWEEN:
        fast = at_setting(SENSOR, "fast")
        return dataclasses.replace(fast, texels_per_pixel=BETWEEN[name])
    return at_setting(SENSOR, {FAST: "fast", DEFAULT: "default"}[name])


class Field(Closeable):
    """All renderers of the race in one scene; close it at the end.

    Attributes:
        peers: available renderers by name.
        missing: reasons why other renderers are unavailable, by name.
    """

    def __init__(self, stage: Stage, device: int | None = None):
        scene, context = stage.scene, stage.context
        make: dict[str, Callable[[], Peer]] = {
            **{name: partial(Omnisim, stage, rung(name), name) for name in LADDER},
            UNLIT: lambda: Omnisim(stage, rung(FAST), UNLIT, unlit=True),
            PAPER: lambda: PaperWay(context, scene),
            GAZEBO: lambda: GazeboWay(context, scene),
        }
        self.missing: dict[str, str] = {}
        faces_of_pyrender = import_failure("pyrender") or import_failure("cv2")
        if faces_of_pyrender:
            self.missing |= dict.fromkeys((PYRENDER, PYRENDER_FLAT), faces_of_pyrender)
        else:
            make[PYRENDER] = lambda: PyrenderFaces(scene, lit=True, device=device)
            make[PYRENDER_FLAT] = lambda: PyrenderFaces(scene, lit=False, device=device)
        if rays := import_failure("embreex"):
            self.missing |= dict.fromkeys((EMBREE, EMBREE_COLOR), rays)
        else:
            make[EMBREE] = lambda: EmbreeGeometry(scene)
            make[EMBREE_COLOR] = lambda: EmbreeColors(scene)
        self.peers: dict[str, Peer] = {}
        try:
            for name in NAMES:
                if name in make:
                    with stage.current():  # anew for each: pyrender leaves none current
                        self.peers[name] = make[name]()
        except BaseException:
            self.close()
            raise

    @property
    def images(self) -> dict[str, ImagePeer]:
        """Renderers that produce an image, by name."""
        return {name: peer for name, peer in self.peers.items() if isinstance(peer, ImagePeer)}

    def close(self) -> None:
        """Release the renderers' resources."""
        for peer in self.peers.values():
            peer.close()
