"""Every command and code block of README and the documentation, run page by page, in order.

A page's blocks share one empty folder with a link to `examples/`. Shell and Python blocks are run;
a TOML block whose first line is `# name.toml` becomes that file. Other blocks are not for running.
"""

import ast
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from tests.printed_numbers import PRINTED_NOISE
from tests.slow import slow_but

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted({ROOT / "README.md", *(ROOT / "docs").rglob("*.md")})
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
INCLUDE = re.compile(r"^```\{include\} (\S+)$", re.MULTILINE)
# They take more than 6 s each. That their commands have such options is tested in test_commands.
LONG = {
    "docs/explanation/rendering.md",
    *(f"docs/how-to/{name}.md" for name in (
        "any-optics", "batches", "calibrations", "change-scene", "choose", "data-sets", "drives",
        "evaluate",
        "ground-truth", "light", "live", "measure-camera", "measure-noise", "measure-sharpness",
        "mirror-mesh", "moving-objects", "own-camera-model", "own-scene", "own-world", "python",
        "rays", "rigs", "robots", "serve", "troubleshooting", "unwarp", "use-with",
        "which-model-is-my-camera", "your-simulator",
    )),
    *(f"docs/reference/{name}.md" for name in ("calibration-formats", "channels")),
    *(f"docs/tutorials/{name}.md" for name in (
        "ball-bearing", "camera-twin", "first-image", "labeled-drive", "own-lens",
        "self-localization",
    )),
}  # fmt: skip
# Notices on files are for whoever runs the block.
WARNINGS = ("-W", "error", "-W", "ignore::omnisim.core.errors.NoticeWarning")
SESSIONS: list[int] = []  # of a page's blocks, which may leave servers behind
MAIN = (
    "import sys; sys.argv[0] = 'omnisim'; from omnisim.apps.cli.start import main; sys.exit(main())"
)


def _text(page):
    """The text of a page, with that of the pages it includes."""
    text = page.read_text(encoding="utf-8")
    for name in INCLUDE.findall(text):
        text += _text(page.parent / name)
    return text


def _blocks(page):
    return [block for block in BLOCK.findall(_text(page)) if block[0] in ("sh", "python", "toml")]


def test_names_that_blocks_import_exist():
    """Check all pages, as those that take long are seldom run."""
    missing = []
    for page in PAGES:
        for language, code in _blocks(page):
            for node in ast.walk(ast.parse(code)) if language == "python" else ():
                if isinstance(node, ast.ImportFrom) and node.module.startswith("omnisim"):
                    for alias in node.names:
                        try:
                            getattr(import_module(node.module), alias.name)
                        except (ImportError, AttributeError) as reason:
                            missing.append(f"{page.relative_to(ROOT)}: {reason}")
    assert not missing, "\n".join(missing)


@pytest.fixture
def folder(tmp_path):
    """An empty folder with the examples and an `omnisim` command."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    commands = tmp_path / ".bin"
    commands.mkdir()
    for name, arguments in (("omnisim", f"-c {MAIN!r}"), ("python", "")):
        command = commands / name
        command.write_text(f'#!/bin/sh\nexec {sys.executable} {arguments} "$@"\n')
        command.chmod(0o755)
    yield tmp_path
    for session in SESSIONS:
        with suppress(ProcessLookupError):
            os.killpg(session, signal.SIGTERM)
    SESSIONS.clear()


def _run(arguments, folder):
    environment = os.environ | {
        "PATH": f"{folder / '.bin'}:{os.environ['PATH']}",
        "PYTHONPATH": f"{ROOT}:{os.environ.get('PYTHONPATH', '')}",
    }
    with subprocess.Popen(
        arguments, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, start_new_session=True,
    ) as started:  # fmt: skip
        SESSIONS.append(started.pid)
        output, _ = started.communicate()
    assert started.returncode == 0, f"{arguments[-1]}\n{output}"
    return output


NAMES = [str(page.relative_to(ROOT)) for page in PAGES if _blocks(page)]


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("page", slow_but(NAMES, long=LONG))
def test_blocks_run(page, folder):
    for language, code in _blocks(ROOT / page):
        if language == "toml":
            name = re.match(r"# (\S+\.toml)\n", code)
            if name:
                (folder / name[1]).write_text(code, encoding="utf-8")
        elif language == "sh":
            assert not PRINTED_NOISE.findall(_run(["bash", "-euc", code], folder)), code
        else:
            _run([sys.executable, *WARNINGS, "-c", code], folder)


NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.name)
def test_notebooks_run(notebook, folder):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    _run([sys.executable, "-W", "error", "-c", code], folder)
    assert not any(cell.get("outputs") for cell in cells), "want a notebook without outputs"


@pytest.mark.slow
def test_documentation_builds_without_a_warning_or_the_net(tmp_path):
    pytest.importorskip("sphinx", reason="Sphinx, of the extra docs, is not installed")
    arguments = ["-m", "sphinx", "-q", "-W", "-b", "html", str(ROOT / "docs"), str(tmp_path)]
    _run([sys.executable, *arguments], ROOT)
    loaded = re.compile(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"https?:")
    for page in tmp_path.rglob("*.html"):
        assert not loaded.search(page.read_text(encoding="utf-8")), page.name
