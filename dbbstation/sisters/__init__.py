"""Machines of one kind compared."""
