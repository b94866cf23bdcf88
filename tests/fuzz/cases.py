"""Cases: one damaged sample each, and the faults that reading it may show."""

import os
import re
import resource
import shutil
import traceback
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

from omnisim.core.errors import NoticeWarning, OmnisimError
from tests.fuzz.mutations import mutate
from tests.fuzz.readers import READERS

MAX_LINE = 700
MAX_BYTES = 512 << 20  # that reading a sample of some kilobytes may add
SILENT = (
    DeprecationWarning,
    PendingDeprecationWarning,
    ImportWarning,
    ResourceWarning,
    NoticeWarning,  # notices of a file that is read
)


@dataclass(frozen=True)
class Case:
    """Sample of a reader with damage by a seed and a number."""

    reader: str
    number: int
    seed: int

    def __str__(self) -> str:
        return f"{self.reader}:{self.number}"

    @property
    def command(self) -> str:
        """Command that repeats it."""
        return f"python -m tests.fuzz --repeat {self} --seed {self.seed}"


@dataclass(frozen=True)
class Finding:
    """Fault that a case shows.

    Attributes:
        case: repeats it.
        kind: of the fault; equal for cases of the same one.
        detail: of this case.
    """

    case: Case
    kind: str
    detail: str


class Samples:
    """Valid samples of readers, in a folder each.

    Args:
        folder: an empty one; or one with the samples already, of another process.
        names: of the readers.
    """

    def __init__(self, folder: Path, names: tuple[str, ...]):
        self.folder = folder
        self._files: dict[str, dict[str, bytes]] = {}
        for name in names:
            place = folder / name
            if not place.is_dir():
                place.mkdir(parents=True)
                with _inside(folder):
                    READERS[name].build(place)
            paths = sorted(path for path in place.rglob("*") if path.is_file())
            self._files[name] = {str(path.relative_to(place)): path.read_bytes() for path in paths}
        self._all = [data for files in self._files.values() for data in files.values()]

    def copy(self, folder: Path) -> "Samples":
        """Samples in another folder."""
        shutil.copytree(self.folder, folder)
        return Samples(folder, tuple(self._files))

    def damaged(self, case: Case) -> tuple[str, bytes]:
        """Name and content of the file that a case damages."""
        rng = Random(f"{case.seed} {case}")
        files = self._files[case.reader]
        name = rng.choice(READERS[case.reader].damaged or tuple(files))
        with _inside(self.folder):
            return name, mutate(files[name], name, rng.choice(self._all), rng)

    def check(self, case: Case) -> Finding | None:
        """Read a damaged sample, and put the valid one back."""
        place = self.folder / case.reader
        name, data = self.damaged(case)
        (place / name).write_bytes(data)
        try:
            with _inside(self.folder):
                return _read(case, place)
        finally:
            (place / name).write_bytes(self._files[case.reader][name])


def _read(case: Case, place: Path) -> Finding | None:
    Path("/proc/self/clear_refs").write_text("5")  # forgets the largest memory until here
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            READERS[case.reader].read(place)
        except OmnisimError as reason:
            if fault := message_fault(str(reason), str(place)):
                return Finding(case, f"message of {case.reader} {fault}", str(reason))
        except BaseException as reason:
            if isinstance(reason, KeyboardInterrupt):
                raise
            return Finding(case, _kind(reason), "".join(traceback.format_exception(reason)))
    for warning in caught:
        if not issubclass(warning.category, SILENT):
            where = f"{Path(warning.filename).name}:{warning.lineno}"
            return Finding(case, f"warning: {warning.category.__name__} {where}", str(warning))
    added = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) << 10
    if added > MAX_BYTES:
        return Finding(case, f"memory: more than {MAX_BYTES >> 20} MiB", f"{added >> 20} MiB")
    return None


def message_fault(message: str, place: str) -> str:
    """Fault of an error's message about files of a folder; empty: there is none."""
    for line in message.split("\n"):
        if place not in line:
            return "names no file"
        if not line.isprintable():
            return "has a letter that cannot be printed"
        if len(line) > MAX_LINE:
            return f"has more than {MAX_LINE} letters in a line"
    if re.search(r"\((?!OS)\w*Error\)|Traceback|object at 0x|numpy\.|<class '", message):
        return "speaks of Python"
    return ""


def _kind(reason: BaseException) -> str:
    """Type of an exception, and the line that raised it."""
    frames = traceback.extract_tb(reason.__traceback__)
    ours = [frame for frame in frames if "/omnisim/" in frame.filename] or list(frames)
    where = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}" if ours else "?"
    return f"{type(reason).__name__} {where}"


@contextmanager
def _inside(folder: Path):
    """Work in a folder: names of files in samples are relative."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
