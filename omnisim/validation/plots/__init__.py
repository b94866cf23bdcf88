"""Figures and videos of results (the home of matplotlib)."""
