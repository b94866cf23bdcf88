"""Shading of hits: `shading` combines materials, light and secondary rays."""
