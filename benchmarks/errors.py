"""Errors that the user of a benchmark can correct."""

from omnisim.core.errors import OmnisimError


class BenchmarkError(OmnisimError):
    """Invalid options, a failed process, or a report that does not match the schema."""
