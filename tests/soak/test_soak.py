"""Short versions of `python -m tests.soak`."""

import subprocess
import sys

import pytest

from tests.soak.kills import kills

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_killed_at_any_moment_a_drive_resumes_and_ends_the_same(tmp_path, seed):
    kills(tmp_path, 3, seed)


@pytest.mark.slow
def test_dropped_renderers_take_no_more_memory_than_a_few():
    """In a process of its own: memory of other tests would hide it."""
    command = [sys.executable, "-m", "tests.soak", "renderers", "--times", "200"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + done.stdout


@pytest.mark.slow
@pytest.mark.long
def test_frames_take_no_more_memory_than_a_few():
    """In a process of its own: memory of other tests would hide it."""
    command = [sys.executable, "-m", "tests.soak", "frames", "--times", "6000"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + done.stdout


@pytest.mark.slow
@pytest.mark.long
def test_random_use_of_the_live_page_takes_no_more_memory_and_never_fails():
    """In a process of its own: memory of other tests would hide it."""
    command = [sys.executable, "-m", "tests.soak", "live", "--times", "50"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
