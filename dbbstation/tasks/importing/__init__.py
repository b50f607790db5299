"""Recordings made elsewhere, taken into a session: what their columns mean, which runs they are, what had to be computed."""
