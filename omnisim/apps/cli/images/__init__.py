"""Commands that create images."""
