"""Parameters of tests of which `make test` takes a few, and `make test-all` all."""

import pytest


def slow_but(values, *quick, long=()):
    """The values, as parameters that are slow but for the quick ones; some are also long."""
    marks = {value: () if value in quick else (pytest.mark.slow,) for value in values}
    marks |= {value: (pytest.mark.slow, pytest.mark.long) for value in long}
    return [pytest.param(value, marks=mark) for value, mark in marks.items()]
