from typing import Literal, TypedDict, overload

import numpy as np
from numpy.typing import NDArray

class Hits(TypedDict):
    primID: NDArray[np.int32]
    tfar: NDArray[np.float32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    Ng: NDArray[np.float32]

class EmbreeScene:
    @overload
    def run(
        self, vec_origins: NDArray[np.float32], vec_directions: NDArray[np.float32]
    ) -> NDArray[np.int32]: ...
    @overload
    def run(
        self,
        vec_origins: NDArray[np.float32],
        vec_directions: NDArray[np.float32],
        dists: NDArray[np.float32] | None = None,
        *,
        output: Literal[True],
    ) -> Hits: ...
