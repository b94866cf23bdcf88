"""Rays: pictures and hits by casting them, with Embree, without any GPU."""
