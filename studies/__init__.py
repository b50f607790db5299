"""Reproducible experiments of a checkout: `dbbstation study`."""
