"""Proof that the pictures are right: omnisim held against what it does not contain."""
