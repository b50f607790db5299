"""Recordings made elsewhere as a session: columns, runs, computed values."""
