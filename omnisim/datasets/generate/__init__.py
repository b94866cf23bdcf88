"""Data sets generated from a plan, in shards."""
