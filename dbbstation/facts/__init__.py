"""A value with its uncertainty, and the one way to JSON."""
