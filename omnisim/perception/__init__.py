"""Perception: views unwarped from omnidirectional images, color models and landmarks."""
