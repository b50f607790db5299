"""Machines of one kind, each held against the others."""
