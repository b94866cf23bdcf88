"""Coarse shadow maps, but where images with shadows are compared with others."""

import pytest

FINE = {"test_body", "test_ray_backend", "test_skins"}
FINE_FOLDERS = {"baking", "opengl", "rays"}


@pytest.fixture(scope="module", autouse=True)
def _coarse(request):
    """Take a sixteenth of the texels."""
    if request.path.stem not in FINE and not FINE_FOLDERS & set(request.path.parts):
        request.getfixturevalue("coarse_shadows")
