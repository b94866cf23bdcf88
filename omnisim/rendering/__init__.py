"""Rendering: images and ground truth of a scene, by OpenGL or by rays."""
