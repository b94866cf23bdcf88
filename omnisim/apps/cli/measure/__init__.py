"""Commands of `omnisim measure`: a camera measured from its own images."""
