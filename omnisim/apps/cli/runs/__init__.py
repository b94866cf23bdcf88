"""Commands for drives, runs and robots."""
