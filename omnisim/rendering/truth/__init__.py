"""Ground truth of a camera's image."""
