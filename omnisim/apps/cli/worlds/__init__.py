"""Commands for scenes."""
