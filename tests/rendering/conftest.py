"""Coarse shadow maps, but where images with shadows are compared with others."""

import pytest

from omnisim.rendering.rays.shading import ray_optics
from omnisim.scene.reflection_probes import Reflectors

FINE = {"test_body", "test_materials_by_chance", "test_ray_backend", "test_skins"}
FINE_FOLDERS = {"baking", "opengl", "rays"}


@pytest.fixture(scope="module", autouse=True)
def _coarse(request):
    """Take a sixteenth of the texels."""
    if request.path.stem not in FINE and not FINE_FOLDERS & set(request.path.parts):
        request.getfixturevalue("coarse_shadows")


@pytest.fixture
def untraced_reflections(monkeypatch):
    """Reflections of sky and lamps alone, in both back ends."""
    monkeypatch.setattr(ray_optics, "MAX_BOUNCES", 0)
    monkeypatch.setattr(
        "omnisim.rendering.opengl.world.scene_buffers.find_reflectors",
        lambda *_: Reflectors((), (), ()),
    )
