"""Simulators of the user: read from their files, run in processes of their own, written out as code."""
