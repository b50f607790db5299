"""Instruments: one protocol file each."""
