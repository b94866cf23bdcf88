"""Degradations: full-screen passes over the linear image."""
