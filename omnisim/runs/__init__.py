"""Runs: drives of vehicles through scenes, and what they record."""
