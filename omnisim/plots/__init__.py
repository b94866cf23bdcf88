"""What was measured, as plots (the home of matplotlib)."""
