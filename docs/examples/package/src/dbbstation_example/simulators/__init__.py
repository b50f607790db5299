"""Simulators: one file each, with the program beside it."""
