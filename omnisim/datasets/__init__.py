"""Data sets: images with ground truth from one plan, in deterministic shards."""
