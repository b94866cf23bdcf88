"""Other people's renderers and libraries, each behind one small function; all are optional."""
