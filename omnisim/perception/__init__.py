"""Perception: views unwarped from omnidirectional pictures, colour models and landmarks."""
