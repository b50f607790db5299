"""Typed results of tasks: frozen, units in their names, uncertainties beside values."""
