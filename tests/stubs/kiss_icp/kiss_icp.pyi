from typing import Any

from kiss_icp.config import KISSConfig

class KissICP:
    last_pose: Any
    def __init__(self, config: KISSConfig) -> None: ...
    def register_frame(self, frame: Any, timestamps: Any) -> tuple[Any, Any]: ...
