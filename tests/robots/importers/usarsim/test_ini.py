"""The syntax of USARBot.ini."""

import pytest

from omnisim.core.errors import RobotFileError
from omnisim.robots.importers.usarsim.usarsim_parts import parse_struct, read_ini


@pytest.fixture
def read(tmp_path):
    def read_text(text):
        path = tmp_path / "a.ini"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_ini(path)

    return read_text


def struct_of(read, value):
    return parse_struct(read(f"[a]\nSensors={value}\n")["a"].entries[0])


@pytest.mark.parametrize(
    ("ending", "coding"),
    [("\n", "utf-8"), ("\r\n", "utf-8-sig"), ("\r", "utf-16"), ("\n", "cp1252")],
)
def test_sections_and_lines(read, ending, coding):
    lines = ["; one", "", "[Bot.A] ; first", "x = 1", "// two", "[Bot.B]", "+Y(0)=(Z=1)", "[bot.a]"]
    sections = read(ending.join([*lines, "X=Müller"]).encode(coding))
    assert list(sections) == ["bot.a", "bot.b"]
    assert (sections["bot.a"].name, sections["bot.a"].line) == ("Bot.A", 3)
    found = [(e.key, e.value, e.line) for e in sections["bot.a"].values_of("X")]
    assert found == [("x", "1", 4), ("X", "Müller", 9)]
    assert [(e.key, e.value) for e in sections["bot.b"].entries] == [("Y", "(Z=1)")]


def test_structs(read):
    text = "( A=class'p.(q)' , b=\"x, y\",C=(X=1.5,Y=(Z=-2)),D=,) ; the end"
    assert struct_of(read, text) == {
        "a": ("A", "class'p.(q)'"),
        "b": ("b", '"x, y"'),
        "c": ("C", {"x": ("X", "1.5"), "y": ("Y", {"z": ("Z", "-2")})}),
        "d": ("D", ""),
    }
    assert struct_of(read, "()") == {}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r":1: empty: expected a USARBot\.ini with \[sections\]$"),
        ("hello\n", r":1: 'hello': expected \[section\]$"),
        ("\nx=1\n[a]\n", r":2: 'x=1': expected \[section\]$"),
        ("[a]\n\nhello\n", r":3: 'hello': expected \[section\] or key=value$"),
        ("[a\n", r":1: '\[a': expected \[section\]$"),
        ("x" * 1000, r":1: 'x{40}…': expected"),
        (b"[a]\nx=1\n\x89PNG\x00\x01", r":3: not a text file: expected a USARBot\.ini$"),
    ],
)
def test_what_is_no_ini(read, tmp_path, text, words):
    with pytest.raises(RobotFileError, match=words) as caught:
        read(text)
    assert str(caught.value).startswith(str(tmp_path / "a.ini"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("(A=1", "Sensors: a parenthesis is not closed"),
        ("(A=1))", r"Sensors: '\)' after the last parenthesis: unbalanced parentheses"),
        ("(A=1) b", "Sensors: 'b' after the last parenthesis"),
        ("1", r"Sensors=1: expected \(\.\.\.\)"),
        ('(A="x)', "Sensors: A: a quote is not closed"),
        ("(A=b(c))", "Sensors: A: a parenthesis within a word"),
        ("(1,2)", r"Sensors: '1,2\)': expected name=value"),
        ("(A=1,a=2)", "Sensors: a twice: expected it once"),
        ("(A=" * 2000, "Sensors: more than 8 parentheses deep"),
    ],
)
def test_what_is_no_struct(read, value, words):
    with pytest.raises(RobotFileError, match=r"a\.ini:2: " + words):
        struct_of(read, value)


def test_no_file(tmp_path):
    with pytest.raises(RobotFileError, match="cannot be read: Is a directory"):
        read_ini(tmp_path)
