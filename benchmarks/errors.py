"""Errors that the user of a benchmark can correct."""

from omnisim.core.errors import OmnisimError


class BenchmarkError(OmnisimError):
    """Invalid options, or a report that breaks the schema."""
