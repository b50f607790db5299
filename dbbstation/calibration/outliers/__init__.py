"""Detect and identify outlying runs and displaced balls, and free their parameters."""
