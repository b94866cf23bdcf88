"""Files: images, TOML, CSV and NPZ, written whole or not at all, and their digests."""
