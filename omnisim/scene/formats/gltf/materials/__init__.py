"""Materials of glTF files: factors, textures and packed maps."""
