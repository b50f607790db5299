"""Figures and reports: pictures where people would rather look than read."""
