"""Steps that break as drivers do: `python -m tests.apps.cli.checks.broken_steps STEP FILE`."""

import ctypes
import json
import sys
import time
from pathlib import Path


def main():
    name, file = sys.argv[1:]
    if name == "crashes":
        import faulthandler

        faulthandler.enable()
        ctypes.string_at(0)
    if name == "hangs":
        time.sleep(60.0)
    if name == "raises":
        raise ValueError("no such thing")
    print("MESA: warning: old", file=sys.stderr)
    Path(file).write_text(json.dumps({"status": "ok", "text": "draws"}))


if __name__ == "__main__":
    main()
