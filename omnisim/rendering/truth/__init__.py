"""Ground truth of what a camera sees."""
