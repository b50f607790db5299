"""Findings about measured circles: number, limit, unit."""
