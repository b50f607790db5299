"""Compare two sessions: one is the simulation of the other."""
