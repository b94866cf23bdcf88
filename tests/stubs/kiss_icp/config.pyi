from typing import Any

class KISSConfig:
    data: Any
    mapping: Any
    registration: Any
