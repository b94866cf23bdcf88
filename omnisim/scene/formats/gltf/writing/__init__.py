"""glTF 2.0, written."""
