"""Reproducible experiments of a checkout: `python -m studies`."""
