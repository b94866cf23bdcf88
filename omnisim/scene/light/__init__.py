"""Light of scenes: lamps, sun, sky, fog and baked light."""
