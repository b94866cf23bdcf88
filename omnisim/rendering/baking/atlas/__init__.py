"""Atlas of lightmaps: unwrapping, packing, texels."""
