"""Rays: images and hits by casting them, with Embree, without any GPU."""
