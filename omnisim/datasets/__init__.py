"""Data sets: pictures with ground truth from one plan, in shards that are functions of a number."""
