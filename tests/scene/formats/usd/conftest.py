"""Stages are read in the process of the tests, but where one of their own is what is tested."""

import pytest

from omnisim.scene.formats.usd import reader


@pytest.fixture(autouse=True)
def _stages_are_read_here(request, monkeypatch):
    if "own_process" not in request.fixturenames:
        monkeypatch.setattr(reader, "call_isolated", lambda read, *arguments: read(*arguments))


@pytest.fixture
def own_process():
    """A test with it reads stages as users do, in a process of their own."""


@pytest.fixture
def stage(tmp_path):
    """An empty stage in meters, z up."""
    from tests.scene.formats.usd.stages import new_stage

    return new_stage(tmp_path / "a.usda")
