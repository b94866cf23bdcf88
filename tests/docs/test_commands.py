"""Every `omnisim` command of README and the documentation has options that exist, and their values.

Whether they work is for the tests of blocks, of which the longest run only by `make test-all`.
"""

import re
import shlex

import pytest

from omnisim.apps.cli.app import COMMANDS, GROUPS, command_named
from tests.docs.pages import ROOT

PAGES = sorted({ROOT / "README.md", *(ROOT / "docs").rglob("*.md")})
SHELL = re.compile(r"^```sh\n(.*?)^```$", re.DOTALL | re.MULTILINE)
ENDS = {"|", "||", "&", "&&", ";", ">", ">>", "2>", "<", "(", ")"}


def _commands(page):
    """Words of each command that a page's shell blocks call, without `omnisim` itself."""
    for block in SHELL.findall(page.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            lexer = shlex.shlex(line, posix=True, punctuation_chars="|&;<>()")
            lexer.whitespace_split = True
            words = list(lexer)
            for start in (at for at, word in enumerate(words) if word == "omnisim"):
                end = next((at for at in range(start, len(words)) if words[at] in ENDS), None)
                yield words[start + 1 : end]


def _check(words):
    """Raise a usage error unless a command takes the words; it is not run."""
    name = words[0]
    assert any(name in modules for modules in COMMANDS.values()), f"{name}: no such command"
    parsed, words = command_named(name), words[1:]
    if name in GROUPS:
        child = "show" if name == "scene" and words[0] not in parsed.commands else words[0]
        words = words[1:] if words[0] == child else words
        assert child in parsed.commands, f"omnisim {name} {child}: no such command"
        parsed = parsed.commands[child]
    parsed.make_context(name, list(words))


@pytest.mark.parametrize(
    "page", [page for page in PAGES if any(_commands(page))], ids=lambda page: page.stem
)
def test_commands_are_understood(page):
    for words in _commands(page):
        if not words[0].startswith("--"):
            _check(words)


def test_a_wrong_option_is_refused():
    with pytest.raises(Exception, match="--sizes: omnisim render has no such option"):
        _check(["render", "soccer", "-o", "a.png", "--sizes", "3"])
    with pytest.raises(Exception, match="--size: expected a whole number"):
        _check(["render", "soccer", "-o", "a.png", "--size", "wide"])
