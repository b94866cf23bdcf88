"""File access: images, TOML, CSV and NPZ, written atomically, and file digests."""
