"""Reproducible experiments, each from a seed to its numbers and figures. They run in a checkout: `dbbstation study`."""
