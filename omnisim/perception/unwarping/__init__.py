"""Unwarping of omnidirectional images."""
