"""Shading of hits: `shading` is the whole, of materials, light, and rays that surfaces send on."""
