"""Reproducible experiments: whole jobs and questions, each from a seed to its numbers and figures."""
