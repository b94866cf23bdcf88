"""Short versions of `python -m tests.soak`."""

import subprocess
import sys

import pytest

from tests.soak.kills import kills

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", range(2))
def test_killed_at_any_moment_a_drive_resumes_and_ends_the_same(tmp_path, seed):
    kills(tmp_path, 3, seed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "times"),
    [
        ("renderers", 200),
        pytest.param("frames", 6000, marks=pytest.mark.long),
        pytest.param("live", 50, marks=pytest.mark.long),
    ],
)
def test_memory_is_what_it_was_and_nothing_fails(what, times):
    """In a process of its own: memory of other tests would hide it."""
    command = [sys.executable, "-m", "tests.soak", what, "--times", str(times)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
