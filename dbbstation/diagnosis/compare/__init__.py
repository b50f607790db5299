"""Compare two sessions, using one as simulation of the other."""
