"""Silence of C's standard error: of nothing else, by several threads, and ended once."""

import ctypes
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import pytest

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import quiet_libraries, read_image

LIBRARY = ctypes.CDLL(None)
pytestmark = pytest.mark.skipif(
    not hasattr(LIBRARY, "gnu_get_libc_version"), reason="this C library is not glibc"
)
THREADS, READS = 8, 10
# The last block alone, with its true checksum: libpng prints its error, and returns it.
ONLY_AN_END = b"\x89PNG\r\n\x1a\n" + b"\0\0\0\0IEND\xaeB`\x82"


def print_as_library(text):
    """Print as libpng does, by C's own function."""
    stream = ctypes.c_void_p.in_dll(LIBRARY, "stderr")
    assert LIBRARY.fputs(text.encode(), stream) >= 0


@pytest.fixture
def damaged(tmp_path):
    path = tmp_path / "damaged.png"
    path.write_bytes(ONLY_AN_END)
    return path


def test_only_libraries_are_silent(capfd):
    print_as_library("before\n")
    with quiet_libraries():
        print_as_library("discarded\n")
        os.write(2, b"another thread\n")
        subprocess.run(["sh", "-c", "echo new process >&2"], check=True)
    print_as_library("after\n")
    assert capfd.readouterr().err == "before\nanother thread\nnew process\nafter\n"


def test_silence_ends_with_its_last_user(capfd):
    """In whatever order they came; and an error ends it, too."""
    first, second = ExitStack(), ExitStack()
    first.enter_context(quiet_libraries())
    second.enter_context(quiet_libraries())
    first.close()
    print_as_library("discarded\n")
    second.close()
    print_as_library("heard\n")
    with pytest.raises(ZeroDivisionError), quiet_libraries():
        _ = 1 / 0
    print_as_library("heard again\n")
    assert capfd.readouterr().err == "heard\nheard again\n"


def test_threads_read_damaged_images_while_others_print(damaged, capfd):
    def read(number):
        for _ in range(READS):
            with pytest.raises(OutputError, match=r"damaged\.png: cannot be read"):
                read_image(damaged)
            os.write(2, b"%d\n" % number)

    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(read, range(THREADS)))
    print_as_library("after\n")
    *numbers, last = capfd.readouterr().err.splitlines()
    assert sorted(numbers) == sorted(READS * [str(number) for number in range(THREADS)])
    assert last == "after"


def run(code, path):
    """Run code in a process of its own, and return what it prints to standard error."""
    done = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_a_closed_standard_error_stays_closed(damaged):
    run(
        "import os, pathlib, sys\n"
        "from omnisim.core.errors import OutputError\n"
        "from omnisim.core.files.image_files import read_image\n"
        "path = pathlib.Path(sys.argv[1])\n"
        "os.close(2)\n"
        "try:\n    read_image(path)\nexcept OutputError:\n    pass\n"
        "try:\n    os.fstat(2)\nexcept OSError:\n    sys.exit(0)\n"
        "sys.exit(1)\n",
        damaged,
    )
    assert damaged.read_bytes() == ONLY_AN_END


def test_a_child_forked_meanwhile_has_its_own(damaged):
    """Its parent's other threads, which hold the silence, are not in it."""
    printed = run(
        "import ctypes, os, threading\n"
        "from omnisim.core.files.image_files import quiet_libraries\n"
        "library = ctypes.CDLL(None)\n"
        "def tell(text):\n"
        "    library.fputs(text, ctypes.c_void_p.in_dll(library, 'stderr'))\n"
        "held, done = threading.Event(), threading.Event()\n"
        "def hold():\n"
        "    with quiet_libraries():\n        held.set()\n        done.wait()\n"
        "thread = threading.Thread(target=hold)\n"
        "thread.start()\n"
        "held.wait()\n"
        "if os.fork() == 0:\n"
        "    tell(b'child\\n')\n"
        "    with quiet_libraries():\n        tell(b'discarded\\n')\n"
        "    os._exit(0)\n"
        "os.wait()\n"
        "tell(b'discarded\\n')\n"
        "done.set()\n"
        "thread.join()\n"
        "tell(b'parent\\n')\n",
        damaged,
    )
    assert printed == "child\nparent\n"
