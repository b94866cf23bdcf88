"""Every reader takes its sample, and answers damaged ones with one of omnisim's errors or none.

`python -m tests.fuzz` reads as many as one has time for.
"""

import multiprocessing
import os
import warnings

import pytest

from omnisim.core.errors import MAX_LINE, OmnisimError, printable
from omnisim.scene.formats.usd import reader as usd_reader
from tests.fuzz import cases, workers
from tests.fuzz.__main__ import cases_of
from tests.fuzz.cases import Case, Finding, Samples, message_fault
from tests.fuzz.readers import READERS, Reader
from tests.fuzz.workers import run_cases
from tests.slow import slow_but


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    return Samples(tmp_path_factory.mktemp("fuzz") / "samples", tuple(READERS))


# each of their cases starts a process, which imports usd-core
USD = ("usda", "usdc")


def test_samples_are_valid(samples, monkeypatch):
    monkeypatch.chdir(samples.folder)
    monkeypatch.setattr(usd_reader, "call_isolated", lambda read, *arguments: read(*arguments))
    for name, reader in READERS.items():
        reader.read(samples.folder / name)


def test_damaged_samples_are_one_line(samples):
    inputs = list(cases_of(tuple(READERS), 2 * len(READERS), seed=0))
    of_usd = [case for case in inputs if case.reader in USD]
    inputs = [case for case in inputs if case.reader not in USD] + of_usd[: len(USD)]
    findings = map(samples.check, inputs)
    assert [finding for finding in findings if finding] == []


@pytest.mark.parametrize("count", slow_but([500, 3000], long=[3000]))
def test_many_damaged_samples(samples, tmp_path, count):
    inputs = cases_of(tuple(READERS), count, seed=1)
    events = list(run_cases(samples, inputs, 2, tmp_path))
    assert [event for event in events if isinstance(event, Finding)] == []
    assert sum(event.total() for event in events if not isinstance(event, Finding)) == count


def test_a_case_is_the_same_damage_every_time(samples, tmp_path):
    again = Samples(tmp_path / "again", tuple(READERS))
    for case in cases_of(tuple(READERS), len(READERS), seed=5):
        assert samples.damaged(case) == again.damaged(case)


def _hang():
    while True:
        pass


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        (lambda: 1 // 0, "ZeroDivisionError test_readers.py"),
        (lambda: os._exit(3), "ends the process: exit status 3"),
        (_hang, "hangs: more than 0.5 s"),
        (lambda: os.write(2, b"noise"), "prints to the console"),
        # far above the limit: a forked process may give some of its parent's memory back
        (lambda: b"1" * (200 << 20), "memory: "),
        (lambda: b"1" * (60 << 30), "MemoryError test_readers.py"),
        (lambda: warnings.warn("w", RuntimeWarning, stacklevel=1), "warning: RuntimeWarning"),
    ],
)
def test_faults_of_a_reader_are_findings(tmp_path, monkeypatch, fault, kind):
    """A reader of the test's own, which a forked process has; the cases that follow go on."""
    monkeypatch.setattr(workers, "_SPAWN", multiprocessing.get_context("fork"))
    monkeypatch.setattr(workers, "LIMIT_CPU_S", 0.5)
    monkeypatch.setattr(cases, "MAX_BYTES", 50 << 20)

    def read(path):
        if path.read_bytes() != b"1":
            fault()

    monkeypatch.setitem(READERS, "faulty", Reader("faulty", "a.txt", "1", read))
    damaged = [Case("faulty", number, 0) for number in range(3)]
    events = list(run_cases(Samples(tmp_path / "s", ("faulty",)), iter(damaged), 1, tmp_path))
    findings = [event for event in events if isinstance(event, Finding)]
    assert [finding.case for finding in findings] == damaged
    assert all(finding.kind.startswith(kind) for finding in findings), findings
    assert sum(event["faulty"] for event in events if not isinstance(event, Finding)) == 3


def test_messages_have_lines_that_can_be_printed():
    message = str(OmnisimError("a\x1b[31m\udce9\n" + 2000 * "b"))
    first, second = message.split("\n")
    assert first == "a\\x1b[31m\\udce9"
    assert len(second) <= MAX_LINE
    assert printable("0123456789", 9) == "012 … 789"
    assert message_fault(f"x: {message}", "") == ""
    assert message_fault("x: a (IndexError)", "x") == "speaks of Python"
    assert message_fault("x: a\x07", "x") == "has a letter that cannot be printed"
    assert message_fault("y", "x") == "names no file"
