"""Parameters of tests of which `make test` takes a few, and `make test-all` all."""

import pytest


def slow_but(values, *quick):
    """The values, as parameters that are slow but for the quick ones."""
    return [
        value if value in quick else pytest.param(value, marks=pytest.mark.slow) for value in values
    ]
