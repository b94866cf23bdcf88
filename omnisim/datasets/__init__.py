"""Data sets: images with ground truth from one plan, in shards that are functions of a number."""
