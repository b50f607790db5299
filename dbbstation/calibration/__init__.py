"""Fit errors to raw circles: sources, observability, uncertainty, evaluation."""
