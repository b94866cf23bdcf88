"""The process whose driver draws nothing."""

import os

import pytest

from benchmarks.errors import BenchmarkError
from benchmarks.idle_driver import idle_driver_rows, main
from benchmarks.options import Options

pytestmark = pytest.mark.usefixtures("needs_opengl")


def test_a_driver_that_draws_has_no_rows():
    if os.environ.get("GALLIUM_NOOP"):
        pytest.skip("this process's driver draws nothing")
    assert main("1", "0", "none", "rings") == []


def test_a_process_that_fails_says_why():
    with pytest.raises(BenchmarkError, match=r"without drawing failed: .*device 63"):
        idle_driver_rows(["rings"], Options(1, 0, device=63))
