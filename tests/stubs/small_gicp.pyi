from typing import Any

class PointCloud: ...
class KdTree: ...

class GaussianVoxelMap:
    def __init__(self, leaf_size: float) -> None: ...
    def insert(self, points: PointCloud, T: Any = ...) -> None: ...

class RegistrationResult:
    T_target_source: Any

def preprocess_points(
    points: Any,
    downsampling_resolution: float = ...,
    num_neighbors: int = ...,
    num_threads: int = ...,
) -> tuple[PointCloud, KdTree]: ...
def align(
    target_voxelmap: GaussianVoxelMap,
    source: PointCloud,
    init_T_target_source: Any = ...,
    max_correspondence_distance: float = ...,
    num_threads: int = ...,
    max_iterations: int = ...,
) -> RegistrationResult: ...
