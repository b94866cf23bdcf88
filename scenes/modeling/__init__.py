"""Shared modeling kit of the scenes: shapes, materials, noise, lettering, the stage."""
