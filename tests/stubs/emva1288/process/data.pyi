from typing import Any

class Data1288:
    data: dict[str, Any]
    def __init__(self, data: dict[str, Any]) -> None: ...
