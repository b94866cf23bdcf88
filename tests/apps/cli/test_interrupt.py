"""Ctrl-C: one line and exit status 130 at any moment, and no file that is written in part."""

import signal
import subprocess
import sys
import time

import pytest

from omnisim.apps.cli import INTERRUPTED
from tests.slow import slow_but

CODE = "from omnisim.apps.cli.start import main\nprint('started', flush=True)\nmain()"
RENDER = ("render", "rings", "--size", "2000", "--quality", "default", "-o", "a.png")


def start(folder, code, *arguments):
    """A command of which Python itself has been loaded."""
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # a shell's background job inherits that SIGINT is ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert process.stdout.readline() == "started\n"
    return process


def assert_interrupted(process, folder):
    _, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (INTERRUPTED, "interrupted\n")
    assert not list(folder.iterdir())


MOMENTS_S = [0.06 * step + 0.03 for step in range(20)]


@pytest.mark.parametrize("delay_s", slow_but(MOMENTS_S, MOMENTS_S[0], MOMENTS_S[8]))
def test_at_any_moment(tmp_path, delay_s):
    process = start(tmp_path, CODE, *RENDER)
    time.sleep(delay_s)
    process.send_signal(signal.SIGINT)
    assert_interrupted(process, tmp_path)


INTERRUPTS = """
import importlib.abc, os, runpy, signal, sys

class Interrupts(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == sys.argv[1]:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupts())
print('started', flush=True)
runpy.run_module('omnisim', run_name='__main__', alter_sys=True)
"""


@pytest.mark.parametrize("module", ["omnisim.apps.cli.app", "click"])
def test_while_modules_are_imported(tmp_path, module):
    assert_interrupted(start(tmp_path, INTERRUPTS, module), tmp_path)


IN_A_SCHEMA = """
import os, signal
from pydantic import TypeAdapter
from pydantic_core import core_schema
from omnisim.apps.cli import app, start

class Value:
    def __hash__(self):
        os.kill(os.getpid(), signal.SIGINT)
        return 0

class Type:
    @classmethod
    def __get_pydantic_core_schema__(cls, source, handler):
        return core_schema.literal_schema([Value()])

app.main = lambda: TypeAdapter(Type)
print('started', flush=True)
start.main()
"""


def test_while_a_schema_is_built(tmp_path):
    assert_interrupted(start(tmp_path, IN_A_SCHEMA), tmp_path)


def test_nothing_is_imported_before_it_is_handled():
    code = (
        "import sys\nbefore = set(sys.modules)\n"
        "import omnisim.apps.cli.start\nprint(*sorted(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    tiny = ["omnisim", "omnisim.apps", "omnisim.apps.cli", "omnisim.apps.cli.start"]
    assert done.stdout.split() == [*tiny, "omnisim.core", "omnisim.core.lazy_names"]


# As an extension does that imports an optional module: what escapes is taken for its absence.
SWALLOWS = """
import time
print('started', flush=True)
try:
    time.sleep(20)
except BaseException:
    pass
"""


def test_imports_do_not_swallow_it(tmp_path, tmp_path_factory):
    modules = tmp_path_factory.mktemp("modules")
    (modules / "swallows.py").write_text(SWALLOWS, encoding="utf-8")
    code = (
        f"import sys\nsys.path.append({str(modules)!r})\n"
        "import omnisim.apps.cli.app\n"
        "from omnisim.core.files.atomic_file import write_text, atomic_write\n"
        "from pathlib import Path\n"
        "def run():\n"
        "    with atomic_write(Path('a.txt')) as partial:\n"
        "        partial.touch()\n"
        "        import swallows\n"
        "    print('swallowed')\n"
        "omnisim.apps.cli.app.main = run\n"
        "from omnisim.apps.cli.start import main\nmain()"
    )
    process = start(tmp_path, code)
    process.send_signal(signal.SIGINT)
    assert_interrupted(process, tmp_path)


def test_it_stays_ignored_where_it_was_ignored(tmp_path):
    """As in a background job of a script."""
    code = (
        "import os, signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "import omnisim.apps.cli.app\n"
        "omnisim.apps.cli.app.main = lambda: os.kill(os.getpid(), signal.SIGINT)\n" + CODE
    )
    _, errors = (process := start(tmp_path, code)).communicate(timeout=300)
    assert (process.returncode, errors) == (0, "")
