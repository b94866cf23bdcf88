"""`omnisim schema`."""

from __future__ import annotations

import json

from omnisim.apps.cli.checks.requests import SchemaRequest
from omnisim.apps.cli.console import out
from omnisim.apps.schemas import file_schema


def run(request: SchemaRequest) -> None:
    """Print the JSON Schema of a kind of file."""
    out.print(json.dumps(file_schema(request.file), indent=2, ensure_ascii=False))
