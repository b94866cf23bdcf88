"""`python -m benchmarks`: files, exit status, and one line where something is wrong."""

import json
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure

import benchmarks.__main__ as command
from benchmarks.bounds import Limits
from benchmarks.report import make_report, read_report
from omnisim.core.errors import SceneError
from omnisim.rendering.opengl.gl.context import open_context


def _suite(name, value):
    """A suite with a bound of 1 and a goal of 0.1; None: it cannot be run."""

    def run(options):
        if value is None:
            raise SceneError("there is no such scene")
        context = open_context(options.device)
        rows = [{"variant": "a", "rounds": options.rounds}]
        limits = Limits(bound=1.0, goal=0.1)
        report = make_report(name, options, context, rows, [("cost", value, limits)])
        context.release()
        return report

    return SimpleNamespace(
        run=run, lines=lambda report: [f"table of {name}"], figure=lambda report: Figure((1, 1))
    )


@pytest.fixture
def suites(monkeypatch, needs_opengl):
    made = {"fps": _suite("fps", 2.0), "lenses": _suite("lenses", 0.5)}
    monkeypatch.setattr(command, "SUITES", tuple(made))
    monkeypatch.setattr(command, "find_spec", lambda name: name.rpartition(".")[2] in made)
    monkeypatch.setattr(command, "import_module", lambda name: made[name.rpartition(".")[2]])
    return made


def test_a_suite_writes_its_report_and_its_plot(suites, tmp_path, capsys):
    folder = tmp_path / "new" / "folder"
    assert command.main(["lenses", "-o", str(folder), "--rounds", "4"]) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["lenses.json", "lenses.png"]
    report = read_report(folder / "lenses.json")
    assert report["rows"] == [{"variant": "a", "rounds": 4}]
    shown = capsys.readouterr().out.splitlines()
    assert shown[1] == "table of lenses"
    assert report["machine"]["renderer"] in shown[0]
    assert shown[2:] == [
        f"figure: {folder / 'lenses.png'}", "", "1 of 1 bounds hold; 0 of 1 goals are reached"
    ]  # fmt: skip


def test_a_suite_that_misses_a_bound_runs_again(suites, tmp_path, capsys):
    slow, quiet = suites["fps"].run, _suite("fps", 0.5).run
    runs = [slow, quiet]
    suites["fps"].run = lambda options: runs.pop(0)(options)
    assert command.main(["fps", "-o", str(tmp_path)]) == 0
    assert "fps: measured again, since cost is 2, bound ≤ 1: FAILS" in capsys.readouterr().out
    assert not runs
    assert read_report(tmp_path / "fps.json")["passed"] is True


def test_all_suites_run_before_one_that_failed_counts(suites, tmp_path, capsys):
    suites["fps"] = _suite("fps", None)
    assert command.main(["all", "-o", str(tmp_path)]) == 1
    assert json.loads((tmp_path / "lenses.json").read_text(encoding="utf-8"))["passed"] is True
    assert capsys.readouterr().err == "error: fps: there is no such scene\n"


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["lense"], "suite 'lense': no such suite; did you mean 'lenses'?"),
        (["fps", "--rounds", "0"], "--rounds: expected at least 1, got 0"),
        (["fps", "-o", __file__], f"{__file__}: cannot be created: File exists"),
    ],
)
def test_wrong_arguments_are_one_line(suites, arguments, error, capsys):
    try:
        status = command.main(arguments)
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert capsys.readouterr().err == f"error: {error}\n"
