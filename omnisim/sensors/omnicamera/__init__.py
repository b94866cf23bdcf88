"""Omnidirectional cameras on vehicles."""
