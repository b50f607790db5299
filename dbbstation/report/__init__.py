"""Figures of results, for people and reports."""
