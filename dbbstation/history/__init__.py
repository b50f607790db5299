"""Figures of a machine over its sessions: trends, and changes beyond uncertainty."""
