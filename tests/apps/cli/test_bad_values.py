"""Bad values of every option: one line in omnisim's own words, status 1 or 2, and no traceback.

Each option of each command gets words that no option can have or that only some can. What is valid
ends where rendering begins.
"""

import pytest

from omnisim.apps.cli.options import ENTRIES
from omnisim.core.errors import OmnisimError
from tests.apps.cli import test_usage_errors  # noqa: F401 - imports the requests of all commands
from tests.apps.cli.test_messages import LIBRARIES
from tests.slow import slow_but

BAD = (
    "nan", "inf", "-1", "1e300", "x", "none.file", "/proc/x", "é😀", ".", "..", "/", "", "a\nb",
    "0", "99999999999999999999",
)  # fmt: skip
# They serve a page, or take minutes and no option with a value but files and devices.
LEFT_OUT = {"live", "validate", "experiments", "doctor"}
VALUES = {"scene": ["a.obj"], "path": ["path.csv"], "robot": ["superscout"]}


def _words(entry, field, bad):
    """Words of a command with a bad value for one field, and valid ones for those it requires."""
    arguments, options = entry.path.split(), []
    for other in entry.fields:
        if other.name == field.name:
            values = [bad] * len(field.kinds)
        elif other.is_required:
            values = VALUES.get(other.name) or other.example.split()
        else:
            continue
        if other.is_argument:
            arguments += values
        else:
            options += [other.flags[-1].partition("/")[0], *values]
    return arguments + options


COMMANDS = [path for path, entry in ENTRIES.items() if entry.fields and path not in LEFT_OUT]


@pytest.mark.parametrize("path", slow_but(COMMANDS, long=("bake", "calibration search")))
def test_bad_values_end_in_one_line(omnisim, tmp_path, monkeypatch, path):
    from omnisim.rendering import stage

    def begin(*_, **__):
        raise OmnisimError("work begins")

    monkeypatch.setattr(stage.Stage, "__init__", begin)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    (tmp_path / "path.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    for field in ENTRIES[path].fields:
        for bad in () if field.is_flag else BAD:
            words = _words(ENTRIES[path], field, bad)
            status, _, text = omnisim(*words)
            errors = [line for line in text.splitlines() if not line.startswith("note: ")]
            assert status in (0, 1, 2), (words, text)
            assert len(errors) == bool(status), (words, text)
            assert all(line.startswith("error: ") for line in errors), (words, text)
            assert not LIBRARIES.search(text), (words, text)
