"""The command, as the tests of `omnisim.apps.cli` run it."""

from tests.apps.cli.conftest import omnisim

__all__ = ["omnisim"]
