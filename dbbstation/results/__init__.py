"""Typed, frozen results of tasks, with units in names and uncertainties beside values."""
