"""NC programs: read, compensated, and written in a dialect, as text."""
