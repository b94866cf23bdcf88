"""Coarse shadow maps: no test here is about the rims of shadows."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def _coarse(coarse_shadows):
    """Take a sixteenth of the texels."""
