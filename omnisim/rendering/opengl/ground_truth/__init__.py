"""Ground truth: triangle IDs, ray hits, and occlusion between two frames."""
