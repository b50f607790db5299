"""Import other programs' recordings as a session: columns, runs, computed values."""
