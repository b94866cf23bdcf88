"""Commands of drives, runs and robots."""
