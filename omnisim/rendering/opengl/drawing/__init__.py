"""Drawing of the scene: surface programs, cluster and item drawers, the cube pass."""
