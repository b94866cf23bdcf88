"""The command, as the tests of `omnisim.cli` run it."""

from tests.cli.conftest import omnisim

__all__ = ["omnisim"]
