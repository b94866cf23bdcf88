"""Perception: unwarped views, color models, landmarks, and self-localization."""
