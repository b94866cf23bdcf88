"""Robots out of models of other simulators: what their robot files have in common."""
