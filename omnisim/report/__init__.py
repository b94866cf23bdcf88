"""Reports of measurements against their bounds: JSON, figures and one HTML page."""
