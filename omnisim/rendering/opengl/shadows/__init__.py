"""Shadow maps: depth as the lamps see it."""
