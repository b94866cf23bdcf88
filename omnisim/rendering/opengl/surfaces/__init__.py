"""Programs and drawers of surfaces: clusters, single items, blended ones, and the sky."""
