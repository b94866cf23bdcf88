from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

class Attribute(TypedDict):
    unique_id: int
    data: NDArray[Any]

class DracoPointCloud:
    attributes: list[Attribute]

class DracoMesh(DracoPointCloud):
    faces: NDArray[np.uint32]

def decode(buffer: bytes) -> DracoMesh | DracoPointCloud: ...
