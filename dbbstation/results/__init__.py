"""Typed results of tasks: frozen, units in their names, uncertainties beside values; one serialiser makes JSON of all of them."""
