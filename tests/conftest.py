"""Fixtures for all tests; every floating-point error in NumPy is a failure."""

import os

os.environ.setdefault("PYOPENGL_PLATFORM", "egl")  # before pyrender, an oracle, is imported

import numpy as np
import pytest


@pytest.fixture(scope="session", autouse=True)
def _numpy_errors_are_failures():
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        yield
