"""Shadow maps: depth as seen from the lamps."""
