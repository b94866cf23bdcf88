from typing import Any

class Results1288:
    K: float
    sigma_d: float
    DSNU1288: float
    PRNU1288: float
    index_u_ysat: int
    temporal: dict[str, Any]
    def __init__(self, data: dict[str, Any]) -> None: ...
