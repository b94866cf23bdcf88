"""Camera models, one module each."""
