"""Figures of a machine over its sessions: trends and significant changes."""
