"""Fit error sources to raw circles, with observability, uncertainty and evaluation."""
