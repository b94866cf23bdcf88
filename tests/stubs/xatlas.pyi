import numpy as np
from numpy.typing import NDArray

class ChartOptions: ...

class PackOptions:
    texels_per_unit: float
    padding: int
    bilinear: bool
    rotate_charts_to_axis: bool

class Atlas:
    width: int
    height: int
    def add_mesh(self, positions: NDArray[np.float32], indices: NDArray[np.uint32]) -> None: ...
    def generate(self, chart_options: ChartOptions, pack_options: PackOptions) -> None: ...
    def get_mesh_vertex_assignment(
        self, mesh_index: int
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]: ...
    def __getitem__(
        self, mesh: int
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]: ...
