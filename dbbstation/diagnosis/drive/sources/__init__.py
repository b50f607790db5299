"""Causes beyond mass and viscous friction, one per file."""
