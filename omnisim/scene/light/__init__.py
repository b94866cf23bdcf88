"""Light of scenes: lamps, sun, sky, environment maps and baked light."""
