"""The camera: sensor file, quality, degradations."""
