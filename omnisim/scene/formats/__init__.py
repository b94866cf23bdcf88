"""Scene formats, one folder per format."""
