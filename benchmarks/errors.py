"""What can be put right by whoever runs a benchmark."""

from omnisim.errors import OmnisimError


class BenchmarkError(OmnisimError):
    """Options that no suite can run with, or a report that is not one."""
