"""Other people's software that answers the same question; optional, never part of rendering."""
