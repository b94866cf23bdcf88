"""Names that packages import at first use."""

from importlib import import_module

import pytest

PACKAGES = (
    "omnisim",
    "omnisim.cameras",
    "omnisim.rendering",
    "omnisim.rendering.camera.degradations",
    "omnisim.sensors",
)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_exported_name_is_there_and_no_other(name):
    package = import_module(name)
    assert all(getattr(package, exported) is not None for exported in package.__all__)
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'unknown'"):
        package.unknown  # noqa: B018
