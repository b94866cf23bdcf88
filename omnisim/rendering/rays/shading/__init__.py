"""Shading of rays: lights, shadows, fog, reflectance."""
